"""Burden motion: the gas pushes the burden while it vents through fractures and stemming."""
