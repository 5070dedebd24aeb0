"""Compare models: fits, parts, document, page."""
