"""The Python face: what `import castblast` offers, in memory, with pandas and xarray in and out.

`castblast/__init__.py` gives its fourteen names, each loaded when it is first asked for. The stages
of the command line are shells of files around the same functions.
"""
