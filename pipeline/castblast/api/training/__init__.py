"""Fits and comparisons of models: made, kept in a folder, judged, described."""
