"""What a dataset was made from: told apart before a build goes on, written into the file after it.

Two builds give the same rows if and only if their `made_from` is equal: recipe in SI units without
the keys that change no number, explosives, the sources of the physics, the numerical libraries, and
the datasets that were extended, if any. No time, host or path is part of it or of the file, so that
equal inputs give equal bytes; ACDD's `date_created` is left out for that reason.
"""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from castblast.dataset.file.schema import SCHEMA, SCHEMA_VERSION
from castblast.design.variables import VARIABLES
from castblast.disk.reading import parse_json
from castblast.errors import DatasetError, SpecError
from castblast.identity import document_hash, library_version, source_hash
from castblast.names import printable
from castblast.specs.catalogue import find_explosive
from castblast.specs.explosive import ExplosiveSpec
from castblast.specs.loading import make_spec, parse_yaml, read_yaml_text
from castblast.specs.recipe import DESCRIPTIVE_KEYS, EXECUTION_KEYS, Recipe, RecipeSource
from castblast.version import __version__

#: Sources that can change a number of a dataset.
SOURCES = (
    "kernel.py", "design", "explosive", "nearfield", "burden", "blast", "dataset/rows"
)  # fmt: skip
_LIBRARIES = ("numpy", "scipy", "numba")
_CONTAINERS = ("xarray", "netCDF4", "dask", "distributed", "pydantic")


class Parent(NamedTuple):
    """The dataset that another one extends: its rows come first and are not simulated again.

    Attributes
    ----------
    id : str
    size : int
    content_sha256 : str
    design_sha256 : str
        Of the rows that follow, where they come from a design file; empty where they were drawn.
    """

    id: str
    size: int
    content_sha256: str
    design_sha256: str = ""

    def to_document(self) -> dict[str, Any]:
        """Plain JSON values; no design hash where there is none."""
        return {key: value for key, value in self._asdict().items() if value != ""}


class ExplosiveSource(NamedTuple):
    """An explosive with the text it was read from, which goes into the dataset."""

    name: str
    text: str
    spec: ExplosiveSpec


def load_explosives(source: RecipeSource) -> tuple[ExplosiveSource, ...]:
    """Read the explosives of a recipe, in its order; paths are relative to the recipe.

    Raises
    ------
    SpecError
        All faults of all files, or two explosives of one name.
    """
    found, faults = [], []
    for written in source.recipe.explosives:
        try:
            path = find_explosive(written)
            path = path if path.is_absolute() else source.path.parent / path
            found.append(explosive_from_text(read_yaml_text(path), str(path)))
        except SpecError as fault:
            faults.append(f"{source.path}: explosives: {fault}")
    names = [entry.name for entry in found]
    faults += [
        f"{source.path}: explosives: two are called {name}"
        for name in sorted(set(names))
        if names.count(name) > 1
    ]
    if faults:
        raise SpecError("\n".join(faults))
    return tuple(found)


def explosive_from_text(text: str, where: str) -> ExplosiveSource:
    """Read an explosive from the text of its file; what no flag may hold becomes underscores."""
    spec = make_spec(parse_yaml(text, where), ExplosiveSpec, where)
    return ExplosiveSource(re.sub(r"[^A-Za-z0-9.+_-]+", "_", spec.name).rstrip("_"), text, spec)


def stored_explosives(attributes: Mapping[str, Any], where: str) -> dict[str, ExplosiveSource]:
    """Read the explosives that a dataset carries, by the names of its flags.

    Raises
    ------
    DatasetError
        The attribute is missing or holds no texts.
    SpecError
        A text is no explosive of this version.
    """
    texts = parse_json(str(attributes.get("explosive_specs", "")), f"{where}: explosive_specs: ")
    if not isinstance(texts, dict) or not all(isinstance(text, str) for text in texts.values()):
        message = f"{where}: explosive_specs: texts of explosives by name are needed"
        raise DatasetError(message)
    return {
        name: explosive_from_text(text, f"{where}: {printable(name)}")
        for name, text in texts.items()
    }


def made_from(
    recipe: Recipe, explosives: tuple[ExplosiveSource, ...], parents: tuple[Parent, ...] = ()
) -> dict[str, Any]:
    """Everything that decides the numbers of a dataset, as plain JSON values."""
    content = recipe.model_dump(mode="json", exclude={*DESCRIPTIVE_KEYS, *EXECUTION_KEYS})
    extends = [parent.to_document() for parent in parents]
    return {
        "recipe": content,
        **({"extends": extends} if extends else {}),
        "explosives": {entry.name: entry.spec.sha256() for entry in explosives},
        "code": {"castblast": __version__, "source_sha256": source_hash(SOURCES)},
        "libraries": {
            "python": ".".join(platform.python_version_tuple()[:2]),
            **{name: library_version(name) for name in _LIBRARIES},
        },
    }


def rows_hash(origin: Mapping[str, Any]) -> str:
    """SHA-256 (hex) of a `made_from`."""
    return document_hash(origin)


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Say what differs between two `made_from`: ``variables.ucs.upper: 200 MPa → 250 MPa``."""
    before, after = dict(_leaves(old)), dict(_leaves(new))
    lines = []
    for key in sorted({*before, *after}):
        left, right = before.get(key), after.get(key)
        listed = key.startswith("explosives.") and None in (left, right)
        if left != right and not listed:  # the list of the recipe says that one came or went
            lines.append(_difference(key, left, right))
    return lines


def global_attributes(
    source: RecipeSource,
    explosives: tuple[ExplosiveSource, ...],
    *,
    drawn: int,
    n_ok: int,
    n_failed: int,
    parents: tuple[Parent, ...] = (),
) -> dict[str, Any]:
    """Global attributes of a dataset, after CF-1.11 and ACDD-1.3, without the content hash.

    Parameters
    ----------
    parents : tuple of Parent
        The datasets that were extended one after the other, the oldest first.
    """
    recipe = source.recipe
    origin = made_from(recipe, explosives, parents)
    extends = [parent.to_document() for parent in parents]
    method = "Latin hypercube, impossible rows drawn anew in further batches"
    if any(parent.design_sha256 for parent in parents):
        method += "; some later batches chosen, from design files, training rows only"
    history = f"generated by castblast {__version__} from the recipe it carries"
    if parents:
        history = f"castblast {__version__}: {parents[-1].id} extended to {recipe.size} samples"
    return {
        "Conventions": "CF-1.11, ACDD-1.3",
        "title": recipe.title,
        "summary": recipe.summary or recipe.title,
        "keywords": "rock blasting, borehole pressure, burden velocity, surrogate model",
        "id": f"{recipe.name}/{recipe.version}",
        "naming_authority": "castblast",
        "history": history,
        "source": "castblast: one-dimensional near-field and lumped burden-motion model",
        "processing_level": "simulated",
        "comment": (
            "SI units, angles in radians. A failed sample keeps its row, with its status and NaN "
            "outputs. No time or place applies, so ACDD's geospatial, time coverage and date "
            "attributes are left out."
        ),
        "references": (
            "Blast Movement Simulation through a Hybrid Approach of Continuum, Discontinuum, and "
            "Machine Learning Modeling (the approach); the models are those of source_sha256"
        ),
        "license": recipe.license,
        "creator_name": recipe.creator,
        "product_version": recipe.version,
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "name": recipe.name,
        "dataset_version": recipe.version,
        "recipe": source.text,
        "recipe_sha256": recipe.sha256(),
        "explosive_specs": json.dumps({entry.name: entry.text for entry in explosives}),
        "made_from": json.dumps(origin, sort_keys=True),
        "rows_sha256": rows_hash(origin),
        "source_sha256": origin["code"]["source_sha256"],
        "castblast_version": __version__,
        "dependency_versions": json.dumps(
            {**origin["libraries"], **{name: library_version(name) for name in _CONTAINERS}}
        ),
        "design_method": method,
        "design_seed": str(recipe.seed),
        "designs_drawn": drawn,
        "n_ok": n_ok,
        "n_failed": n_failed,
        **({"extends": json.dumps(extends)} if extends else {}),
    }


def _leaves(tree: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{place}{key}.")
        else:
            yield f"{place}{key}", value


def _difference(key: str, left: Any, right: Any) -> str:
    """Name one difference in the words of the recipe."""
    if key.startswith("explosives."):
        return f"{key.replace('.', ': ', 1)}: its file has changed"
    if key == "code.source_sha256":
        return "the code of the physics has changed"
    shown = key.removeprefix("recipe.").removeprefix("code.").removeprefix("libraries.")
    parts = shown.split(".")
    if parts[0] == "variables" and len(parts) == 3 and parts[1] in VARIABLES:
        left, right = (_show(parts[1], value) for value in (left, right))
    return f"{shown}: {_text(left)} → {_text(right)}"


def _show(name: str, value: Any) -> Any:
    return VARIABLES[name].show(value) if isinstance(value, float) else value


def _text(value: Any) -> str:
    return "(not given)" if value is None else str(value)
