"""The file of a dataset: its form, what it was made from, checks, card."""
