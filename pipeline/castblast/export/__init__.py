"""Export: a trained network in the languages of other tools, each with a proof of parity."""
