"""Tables as people save them: text, heads with units, cells."""
