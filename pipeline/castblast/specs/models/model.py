"""What a surrogate is to be: one frozen spec per family, read from ``models/specs/*.yaml``.

A setting that a family does not use is no field of its spec, so writing it is an error. The name
of a candidate is the name of its file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias, get_args

from castblast.disk.resources import find_spec
from castblast.errors import SpecError, nearest_name
from castblast.specs.loading import make_spec, read_yaml
from castblast.specs.models.base import (
    ALL_FEATURES,
    PAPER_FEATURES,
    PAPER_TARGETS,
    DerivedSpec,
    RandomStarts,
    SurrogateSpec,
)
from castblast.specs.models.families import (
    CustomSpec,
    GaussianProcessSpec,
    GradientBoostingSpec,
    LevenbergSpec,
    MlpSpec,
    RidgeSpec,
    TorchSpec,
)

__all__ = [
    "ALL_FEATURES",
    "PAPER_FEATURES",
    "PAPER_TARGETS",
    "CustomSpec",
    "DerivedSpec",
    "GaussianProcessSpec",
    "GradientBoostingSpec",
    "LevenbergSpec",
    "MlpSpec",
    "ModelSpec",
    "RandomStarts",
    "RidgeSpec",
    "SurrogateSpec",
    "TorchSpec",
    "make_model_spec",
    "read_model_spec",
    "read_model_specs",
    "refuse_code",
]

ModelSpec: TypeAlias = (
    MlpSpec
    | LevenbergSpec
    | TorchSpec
    | GradientBoostingSpec
    | GaussianProcessSpec
    | RidgeSpec
    | CustomSpec
)
_FAMILIES: tuple[type[ModelSpec], ...] = get_args(ModelSpec)
_KINDS: dict[str, type[ModelSpec]] = {
    family.model_fields["kind"].default: family for family in _FAMILIES
}


def read_model_spec(path: Path) -> ModelSpec:
    """Read a candidate from its YAML file, or one that came with castblast, by name.

    Raises
    ------
    SpecError
        Unreadable file, unknown family, unknown or unusable settings; all faults at once.
    """
    path = find_spec(path, "model spec")
    return make_model_spec({"name": path.stem, **read_yaml(path)}, str(path), path.parent)


def make_model_spec(content: Any, where: str, folder: Path) -> ModelSpec:
    """Turn what a file says of a candidate into its spec.

    Parameters
    ----------
    content : mapping
        Plain values, whatever file they come from.
    where : str
        Origin for messages.
    folder : path
        Where a user's own module is looked for unless the content says.

    Raises
    ------
    SpecError
        Unknown family, unknown or unusable settings; all faults at once.
    """
    if not isinstance(content, Mapping):
        message = f"{where}: is not a model spec"
        raise SpecError(message)
    kind = content.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        known = ", ".join(_KINDS)
        what = "is missing" if kind is None else f"{kind}: unknown{nearest_name(str(kind), _KINDS)}"
        message = f"{where}: kind: {what} (known kinds: {known})"
        raise SpecError(message)
    return make_spec(content, _KINDS[kind], where, folder=folder)


def refuse_code(specs: Iterable[ModelSpec], *, allowed: bool) -> None:
    """Refuse specs that run code of their own, unless that was asked for.

    A spec of kind ``custom`` calls any function that it names, so reading one from a stranger
    would be running the stranger's program.

    Raises
    ------
    SpecError
        One line for each of them, with what it would run.
    """
    lines = [
        f"{spec.name}: kind custom runs Python code, {spec.factory}, looked for in {spec.folder} "
        "first; read it, then allow it: --allow-code, in Python allow_code=True"
        for spec in specs
        if isinstance(spec, CustomSpec) and not allowed
    ]
    if lines:
        raise SpecError("\n".join(lines))


def read_model_specs(paths: list[Path]) -> list[ModelSpec]:
    """Read several candidates, reporting the faults of all files at once.

    Raises
    ------
    SpecError
        As `read_model_spec`; also no file at all, or two candidates of one name.
    """
    specs: list[ModelSpec] = []
    faults = [] if paths else ["no model spec given"]
    for path in paths:
        try:
            spec = read_model_spec(path)
        except SpecError as fault:
            faults.append(str(fault))
            continue
        if spec.name in (known.name for known in specs):
            faults.append(f"{path}: name: '{spec.name}' is taken by another spec")
        specs.append(spec)
    if faults:
        raise SpecError("\n".join(faults))
    return specs
