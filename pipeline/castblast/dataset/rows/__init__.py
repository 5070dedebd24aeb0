"""What decides the rows of a dataset: designs drawn or read, and simulated."""
