"""Where the files that come with castblast lie: explosives, recipes, benches and the network.

In an installed package they stand inside it; in a source tree at the top level of the repository.
"""

from __future__ import annotations

from pathlib import Path

from castblast.errors import SpecError

_PACKAGE = Path(__file__).resolve().parent
_ROOTS = (_PACKAGE / "_data", _PACKAGE.parent.parent)


def resource(relative: str) -> Path:
    """Return the path of a shipped file or folder such as ``data_specs/recipes/paper.yaml``.

    Raises
    ------
    SpecError
        The file did not come with this installation.
    """
    for root in _ROOTS:
        if (root / relative).exists():
            return root / relative
    message = f"{relative}: not part of this installation of castblast"
    raise SpecError(message)
