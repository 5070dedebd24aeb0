"""Train and tune models, and list the runs."""
