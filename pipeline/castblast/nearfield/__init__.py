"""Near field: the rock around one blasthole from detonation to the equilibrium pressure."""
