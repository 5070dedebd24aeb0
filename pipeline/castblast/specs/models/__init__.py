"""Specs of models: families, features, what is searched."""
