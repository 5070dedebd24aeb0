"""Bench files and the files that they name."""
