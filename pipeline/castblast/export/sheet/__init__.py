"""The network as a workbook, and as a lookup table."""
