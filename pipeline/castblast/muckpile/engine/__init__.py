"""The engine: forces, motion, steps, what is watched on the way."""
