"""Searches: settings of a model, and the next designs to simulate."""
