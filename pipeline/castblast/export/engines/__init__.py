"""A bench for other engines: decks, and scripts that ask the network."""
