"""A cast described: document, tables, velocity, verdict, files."""
