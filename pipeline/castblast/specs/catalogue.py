"""Names of the explosives that come with castblast: the one place where what people write resolves.

Light on purpose, without the explosives themselves: a prediction must start at once.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path

from castblast.disk.resources import resource
from castblast.errors import SpecError, nearest_name
from castblast.names import shortened
from castblast.specs.loading import read_yaml

FOLDER = "data_specs/explosives"


def spelled(text: str) -> str:
    """Lower case, with one underscore for spaces, hyphens and underscores: ``heavy_anfo``."""
    return "_".join(text.lower().replace("-", " ").replace("_", " ").split())


@cache
def explosive_names() -> tuple[str, ...]:
    """Names of the explosives in the catalogue, in alphabetical order."""
    return tuple(sorted(path.stem for path in resource(FOLDER).glob("*.yaml")))


@cache
def explosive_aliases() -> dict[str, str]:
    """Other names in the catalogue, as `spelled`, to the names they stand for."""
    return {
        spelled(str(alias)): name
        for name in explosive_names()
        for alias in read_yaml(resource(FOLDER) / f"{name}.yaml").get("aliases", ())
    }


def resolve_explosive(text: str, known: Iterable[str] | None = None) -> str | None:
    """Name of an explosive as it is known, for what people write; None: there is none.

    Parameters
    ----------
    text : str
        ``ANFO``, ``Heavy ANFO``, ``heavy-anfo`` or an alias of the catalogue, such as ``HANFO``.
    known : iterable of str, optional
        Names to choose from, such as those of a network; default: the catalogue.
    """
    names = explosive_names() if known is None else tuple(known)
    if text in names:
        return text
    by_spelling = {spelled(name): name for name in names}
    wanted = spelled(text)
    if wanted in by_spelling:
        return by_spelling[wanted]
    return by_spelling.get(spelled(explosive_aliases().get(wanted, "")))


def find_explosive(name_or_path: str | Path) -> Path:
    """Path of the file of an explosive: of the catalogue, by name or alias, or a user's own.

    Raises
    ------
    SpecError
        Unknown name; the nearest is named.
    """
    text = str(name_or_path)
    path = Path(text)
    if path.suffix or path.parent != Path() or path.is_file():
        return path
    name = resolve_explosive(text)
    if name is not None:
        return resource(FOLDER) / f"{name}.yaml"
    known = ", ".join(explosive_names())
    hint = nearest_name(spelled(text), (*explosive_names(), *explosive_aliases()))
    asked = f"unknown explosive '{shortened(text)}'{hint or ';'}"
    message = f"{asked} known: {known}; or the path of a YAML file"
    raise SpecError(message, field="explosive", value=text, allowed=explosive_names())
