"""Where the files that come with castblast lie: explosives, recipes, benches and the network.

In an installed package they stand inside it; in a source tree at the top level of the repository.
Wherever a file is asked for, a file that came with castblast can be given by its bare name.
"""

from __future__ import annotations

from pathlib import Path

from castblast.errors import SpecError, nearest_name

_PACKAGE = Path(__file__).resolve().parents[1]
_ROOTS = (_PACKAGE / "_data", _PACKAGE.parent.parent)

#: Folders of shipped specs by what people call one of them.
SPEC_FOLDERS = {
    "explosive": "data_specs/explosives",
    "recipe": "data_specs/recipes",
    "bench": "data_specs/benches",
    "case": "data_specs/cases",
    "model spec": "models/specs",
}

#: Networks that come with castblast, by the recipe of their dataset; the first is the default.
SHIPPED_NETWORKS = {
    "full": "models/chosen/network.json",
    "paper": "models/chosen/paper/network.json",
}


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


def shipped_specs(kind: str) -> dict[str, Path]:
    """Name and path of every shipped spec of a kind of `SPEC_FOLDERS`, in alphabetical order."""
    return {path.stem: path for path in sorted(resource(SPEC_FOLDERS[kind]).glob("*.yaml"))}


def is_bare_name(name_or_path: str | Path) -> bool:
    """Tell a bare name such as ``paper`` from the path of a file.

    A folder of that name does not hide what ships: results often lie in one.
    """
    path = Path(name_or_path)
    return not (path.suffix or path.parent != Path() or path.is_file())


def find_spec(name_or_path: str | Path, kind: str) -> Path:
    """Path of a spec: a user's own file, or one that came with castblast, by name.

    Parameters
    ----------
    name_or_path : str or Path
    kind : str
        A key of `SPEC_FOLDERS`.

    Raises
    ------
    SpecError
        A bare name that no shipped spec has; the nearest is named.
    """
    if not is_bare_name(name_or_path):
        return Path(name_or_path)
    known = shipped_specs(kind)
    name = str(name_or_path)
    if name in known:
        return known[name]
    hint = nearest_name(name, known)
    message = f"unknown {kind} '{name}'{hint or ';'} known: {', '.join(known)}; or a YAML file"
    raise SpecError(message)
