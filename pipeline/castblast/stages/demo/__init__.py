"""The whole chain at a small size."""
