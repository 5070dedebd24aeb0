"""The version of castblast, in a file of its own, below everything else."""

__version__ = "0.1.0"
