"""The card of a dataset: a datasheet (Gebru et al. 2021) written from the file alone.

Statistics are those of the training rows only, so that nobody scales by rows they test on.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import xarray as xr

from castblast.dataset.file.failures import summary
from castblast.dataset.file.schema import flag_counts, flag_rows, names_with_role
from castblast.design.variables import VARIABLES
from castblast.disk.files import write_text
from castblast.errors import Status

_INTENDED = (
    "Training and comparing surrogates of the near-field and burden-motion models. Fit on `train`, "
    "choose between models on `valid`, make error bands from `calibration`, publish scores from "
    "`test` only."
)
_LIMITS = (
    "Every number is the output of a model, none is a measurement. The near field is "
    "one-dimensional, the rock rate-independent and unjointed; the parameters of the burden motion "
    "are checked against a published system, not calibrated on blasts and not validated. Do not "
    "use the data outside the ranges below, nor in place of a blast design by a competent person."
)
_UPKEEP = (
    "The file carries its recipe and its explosives; `castblast dataset reproduce` recomputes any "
    "sample from them. A new meaning of a variable raises the major version, new ranges or physics "
    "the minor one; a published version is never overwritten."
)


def training_statistics(dataset: xr.Dataset, name: str) -> dict[str, float]:
    """Mean, standard deviation, smallest and largest value over the finished training rows.

    Returns
    -------
    dict of float [SI]
        NaN where there are no such rows.
    """
    values = np.broadcast_to(dataset[name].to_numpy(), dataset.sizes["sample"])
    ok = dataset["status"].to_numpy() == Status.OK
    rows = values[ok & flag_rows(dataset["split"], "train")]
    if not len(rows):
        return dict.fromkeys(("mean", "std", "min", "max"), float("nan"))
    return {
        "mean": float(rows.mean()),
        "std": float(rows.std()),
        "min": float(rows.min()),
        "max": float(rows.max()),
    }


def make_card(dataset: xr.Dataset) -> str:
    """Write the card as Markdown."""
    attributes = dataset.attrs
    sections = (
        ("Motivation", _motivation(dataset)),
        ("Composition", _composition(dataset)),
        ("Collection", _collection(dataset)),
        ("Uses", _INTENDED),
        ("Limits", _LIMITS),
        ("Distribution and upkeep", f"Licence of the data: {attributes['license']}. {_UPKEEP}"),
    )
    text = f"# {attributes['title']}\n\n`{attributes['id']}`, made by castblast"
    text += f" {attributes['castblast_version']}; this page is generated from the file.\n"
    return text + "".join(f"\n## {title}\n\n{body.strip()}\n" for title, body in sections)


def write_card(dataset: xr.Dataset, path: Path) -> Path:
    """Write the card of a dataset to `path`."""
    return write_text(path, make_card(dataset))


def _motivation(dataset: xr.Dataset) -> str:
    return str(dataset.attrs["summary"])


def _composition(dataset: xr.Dataset) -> str:
    inputs = [
        (*_named(name), _sampling(dataset, name)) for name in names_with_role(dataset, "input")
    ]
    outputs = [
        (*_named(name), *_shown_statistics(dataset, name))
        for role in ("target", "diagnostic")
        for name in names_with_role(dataset, role)
    ]
    fixed = ", ".join(
        f"{name} {VARIABLES[name].show(float(dataset[name]))}"
        for name in names_with_role(dataset, "fixed")
    )
    return "\n\n".join(
        (
            summary(dataset["status"].to_numpy()) + ". A failed sample keeps its row.",
            f"Splits: {_counts(dataset['split'])}. Explosives: {_counts(dataset['explosive'])}.",
            _table(("input", "unit", "sampled"), inputs),
            f"The same in every sample: {fixed}." if fixed else "",
            "Outputs over the finished training samples:",
            _table(("output", "unit", "mean", "std", "min", "max"), outputs),
        )
    )


def _collection(dataset: xr.Dataset) -> str:
    attributes = dataset.attrs
    size = dataset.sizes["sample"]
    drawn = int(attributes["designs_drawn"])
    recipe, physics, content = (
        str(attributes[key])[:12] for key in ("recipe_sha256", "source_sha256", "content_sha256")
    )
    return (
        f"{attributes['design_method']} (seed {attributes['design_seed']}): {drawn} designs drawn "
        f"for {size} possible ones ({size / drawn:.1%} accepted). SHA-256: recipe `{recipe}`, "
        f"physics `{physics}`, content `{content}`."
    )


def _named(name: str) -> tuple[str, str]:
    unit = VARIABLES[name].shown_unit
    return f"{name}: {VARIABLES[name].long_name}", "" if unit == "1" else unit


def _sampling(dataset: xr.Dataset, name: str) -> str:
    attributes = dataset[name].attrs
    ratio = attributes.get("sampled_as_ratio_of")
    factor = 1.0 if ratio else VARIABLES[name].display_factor
    low, high = (attributes[key] * factor for key in ("sampled_lower", "sampled_upper"))
    of = f" times {ratio}" if ratio else ""
    return f"{low:.6g} to {high:.6g}{of}, {attributes['sampled_distribution'].replace('_', '-')}"


def _shown_statistics(dataset: xr.Dataset, name: str) -> tuple[str, ...]:
    factor = VARIABLES[name].display_factor
    return tuple(f"{v * factor:.4g}" for v in training_statistics(dataset, name).values())


def _counts(variable: xr.DataArray) -> str:
    return ", ".join(f"{name} {count}" for name, count in flag_counts(variable).items())


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [header, ("---",) * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
