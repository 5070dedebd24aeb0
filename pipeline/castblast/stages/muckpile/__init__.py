"""Throw a bench, measure a pile, compare piles."""
