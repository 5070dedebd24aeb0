"""Datasets: design, parallel generation, storage and checks."""
