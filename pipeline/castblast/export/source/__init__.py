"""The network as source code: C, JavaScript, Python."""
