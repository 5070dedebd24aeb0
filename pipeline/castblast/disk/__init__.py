"""Files: read with a limit, written whole or not at all, locked, found in the package."""
