"""Entry of the command line: ``castblast`` and ``python -m castblast``."""

import sys

from castblast.cli import main


def run() -> None:
    """Run the command line and leave with its exit code."""
    sys.exit(main())


if __name__ == "__main__":
    run()
