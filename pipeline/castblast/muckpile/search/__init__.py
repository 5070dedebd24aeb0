"""Who may touch whom: lists of neighbours, pairs and walls."""
