"""What decides a fit: rows, columns, models, training, bands."""
