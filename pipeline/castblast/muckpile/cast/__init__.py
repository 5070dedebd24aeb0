"""One cast: its case, its solution, its restart file."""
