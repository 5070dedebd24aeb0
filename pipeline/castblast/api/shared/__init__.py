"""What all of the face shares: values and tables in, tables and HTML out, progress."""
