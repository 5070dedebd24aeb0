"""Make, extend, check and compare datasets."""
