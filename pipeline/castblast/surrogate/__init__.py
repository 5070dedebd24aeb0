"""Surrogates: training, scoring and tracking of regression models."""
