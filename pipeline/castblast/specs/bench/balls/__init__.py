"""Balls of a bench: sizes to pack, or files of other engines."""
