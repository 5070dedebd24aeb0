"""Ground under and around a bench: heights, points, surfaces."""
