"""Judges of fits: league, physics gate, shifts, strata, Sobol indices."""
