"""Answers of a network: designs completed, refused, predicted; light modules only."""
