"""Rows of a dataset as a table that estimators take: features, targets and the frozen split.

Only rows that finished (`status` 0) enter. The split comes from the dataset, so every model sees
the same rows: train to fit, valid to choose between restarts and models, calibration for the
error band only, test for the published scores only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from castblast.dataset.file.schema import flag_names, is_column, role_of, varying_inputs
from castblast.design.variables import INPUT_NAMES, VARIABLES
from castblast.errors import DatasetError, nearest_name
from castblast.network import Constraint, InputColumn, Transform
from castblast.specs.models.model import ALL_FEATURES
from castblast.types import FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Split = Literal["train", "valid", "calibration", "test"]
SPLITS: tuple[Split, ...] = get_args(Split)

#: Fewest rows per split: 39 is the least that gives a finite 95 % band with a row to spare.
MINIMUM_ROWS: Mapping[Split, int] = {"train": 100, "valid": 20, "calibration": 39, "test": 20}
#: Ratios whose range in training bounds the domain: name, numerator, denominator, both sides?
_RATIOS: tuple[tuple[str, dict[str, float], str, bool], ...] = (
    (
        "bench height less charge length",
        {"bench_height": 1.0, "charge_length": -1.0},
        "burden",
        True,
    ),
    ("charge length", {"charge_length": 1.0}, "bench_height", True),
    ("charge length", {"charge_length": 1.0}, "hole_diameter", False),
    ("stemming length", {"stemming_length": 1.0}, "burden", True),
    ("stemming length", {"stemming_length": 1.0}, "bench_height", True),
    (
        "bench height less stemming length",
        {"bench_height": 1.0, "stemming_length": -1.0},
        "hole_diameter",
        False,
    ),
    ("spacing", {"spacing": 1.0}, "burden", True),
    ("tensile strength", {"tensile_strength": 1.0}, "ucs", True),
)
_PROVENANCE = ("name", "dataset_version", "content_sha256", "recipe_sha256")


@dataclass(frozen=True, eq=False)
class Table:
    """Finished rows of a dataset.

    Attributes
    ----------
    frame : pandas.DataFrame (n rows)
        Numeric features [SI] and the column ``explosive`` (names).
    targets : (n, m) [SI]
    target_names : tuple of str
    explosives : tuple of str
        All names, sorted.
    sample : (n,) int64
        Stable ids of the rows.
    split : (n,) of str
        One of `SPLITS` for each row.
    source : mapping
        Name, version and hashes of the dataset.
    held : mapping of input name to float [SI]
        Inputs that the dataset holds at one value.
    varying : tuple of str
        Inputs that the design of the dataset varies: what the feature name ``all`` stands for.
    descriptors : mapping of explosive to mapping of name to float [SI]
        What the dataset says about each explosive in numbers.
    """

    frame: pd.DataFrame
    targets: FloatArray
    target_names: tuple[str, ...]
    explosives: tuple[str, ...]
    sample: IntArray
    split: NDArray[np.str_]
    source: Mapping[str, str]
    held: Mapping[str, float]
    varying: tuple[str, ...] = ()
    descriptors: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Names of the numeric features."""
        return tuple(name for name in self.frame.columns if name != "explosive")

    def rows(self, *splits: Split) -> IntArray:
        """Positions of the rows of the given splits, in order."""
        return np.flatnonzero(np.isin(self.split, splits)).astype(np.int64)

    def select(self, features: Sequence[str], targets: Sequence[str]) -> Table:
        """Give the same rows with some of the features and targets, in the given order."""
        features = expand(features, self.varying)
        positions = [self.target_names.index(name) for name in targets]
        return replace(
            self,
            frame=self.frame[[*features, "explosive"]],
            targets=self.targets[:, positions],
            target_names=tuple(targets),
        )

    def with_train_rows(self, count: int, seed: int = 0) -> Table:
        """Give the table with only `count` training rows; smaller choices lie in larger ones."""
        train = np.random.default_rng(seed).permutation(self.rows("train"))
        keep = np.ones(len(self.split), dtype=bool)
        keep[train[count:]] = False
        return replace(
            self,
            frame=self.frame[keep],
            targets=self.targets[keep],
            sample=self.sample[keep],
            split=self.split[keep],
        )


def read_table(dataset: xr.Dataset, features: Sequence[str], targets: Sequence[str]) -> Table:
    """Read what training needs from a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
    features : sequence of str
        Numeric inputs; ``all`` stands for every one that the dataset varies.
    targets : sequence of str

    Raises
    ------
    DatasetError
        Missing columns (with the nearest name) and those that are none; numbers that are not
        finite, too few rows of a split, an explosive without training rows; all faults at once.
    """
    varying = varying_inputs(dataset)
    features = expand(features, varying)
    faults = [
        f"{name}: the dataset has no such variable{nearest_name(name, map(str, dataset.data_vars))}"
        for name in (*features, *targets, "explosive", "split", "status")
        if name not in dataset.variables
    ]
    faults += [
        f"{name}: is no column of numbers, one per sample"
        for name in (*features, *targets, "explosive", "split", "status", "sample")
        if name in dataset.variables and not is_column(dataset[name])
    ]
    if faults:
        raise DatasetError("\n".join(faults))
    import pandas as pd

    ok = np.flatnonzero(dataset["status"].to_numpy() == 0)
    columns: dict[str, NDArray[Any]] = {
        name: dataset[name].to_numpy()[ok].astype(np.float64) for name in features
    }
    columns["explosive"] = _labels(dataset["explosive"])[ok]
    table = Table(
        frame=pd.DataFrame(columns),
        targets=np.stack([dataset[name].to_numpy()[ok] for name in targets], axis=1).astype(float),
        target_names=tuple(targets),
        explosives=tuple(sorted({str(name) for name in columns["explosive"]})),
        sample=dataset["sample"].to_numpy()[ok].astype(np.int64),
        split=_labels(dataset["split"])[ok],
        held=_held(dataset, features),
        varying=varying,
        descriptors=_descriptors(dataset),
        source={key: str(dataset.attrs[key]) for key in _PROVENANCE if key in dataset.attrs},
    )
    faults = _faults(table, dropped=dataset.sizes["sample"] - len(ok))
    if faults:
        raise DatasetError("\n".join(faults))
    return table


def expand(features: Sequence[str], varying: Sequence[str]) -> tuple[str, ...]:
    """Feature names with ``all`` replaced by the varying inputs, each name once."""
    names = [n for name in features for n in (varying if (name,) == ALL_FEATURES else (name,))]
    return tuple(dict.fromkeys(names))


def _descriptors(dataset: xr.Dataset) -> dict[str, dict[str, float]]:
    """Numbers per explosive, by its name; none in datasets without them."""
    if "explosive_name" not in dataset.variables:
        return {}
    numbers = {
        str(name).removeprefix("explosive_"): values.to_numpy()
        for name, values in dataset.data_vars.items()
        if role_of(values) == "descriptor"
    }
    return {
        str(name): {key: float(values[k]) for key, values in numbers.items()}
        for k, name in enumerate(dataset["explosive_name"].to_numpy())
    }


def _held(dataset: xr.Dataset, features: Sequence[str]) -> dict[str, float]:
    """Inputs beside the features that have one value in every row."""
    held = {}
    for name in INPUT_NAMES:
        if name in dataset.data_vars and name not in features and is_column(dataset[name]):
            values = np.unique(dataset[name].to_numpy())
            if len(values) == 1:
                held[name] = float(values[0])
    return held


def _labels(variable: xr.DataArray) -> NDArray[np.str_]:
    """Names per sample of a CF flag variable.

    Raises
    ------
    DatasetError
        It has no meanings, or a value beyond them.
    """
    meanings = str(variable.attrs.get("flag_meanings", "")).split()
    values = variable.to_numpy()
    if not np.issubdtype(values.dtype, np.integer) or not meanings:
        message = f"{variable.name}: is not a flag variable (integers with flag_meanings)"
        raise DatasetError(message)
    if values.size and not 0 <= values.min() <= values.max() < len(meanings):
        message = f"{variable.name}: a value has no entry in flag_meanings ({' '.join(meanings)})"
        raise DatasetError(message)
    return flag_names(variable)


def _faults(table: Table, dropped: int) -> list[str]:
    failed = f" ({dropped} failed samples left out)" if dropped else ""
    faults = [
        f"split '{split}': {len(table.rows(split))} finished rows{failed}, "
        f"at least {least} are needed"
        for split, least in MINIMUM_ROWS.items()
        if len(table.rows(split)) < least
    ]
    numeric = {name: table.frame[name].to_numpy() for name in table.feature_names}
    numeric |= dict(zip(table.target_names, table.targets.T, strict=True))
    for name, values in numeric.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            first = table.sample[bad[0]]
            faults.append(f"{name}: not finite in {len(bad)} finished rows, first sample {first}")
    train = table.frame["explosive"].to_numpy()[table.rows("train")]
    faults += [
        f"explosive '{name}': no training rows"
        for name in table.explosives
        if name not in set(train)
    ]
    return faults


def input_columns(
    table: Table, transforms: Sequence[Transform], mean: FloatArray, scale: FloatArray
) -> tuple[InputColumn, ...]:
    """Describe the numeric features with their scaling and the range of the training rows."""
    train = table.frame.iloc[table.rows("train")]
    columns = []
    for j, name in enumerate(table.feature_names):
        values = train[name].to_numpy()
        logged = transforms[j] == "log"
        ends = _trained_range(np.log(values) if logged else values)
        lower, upper = np.exp(ends) if logged else ends
        columns.append(
            InputColumn(
                name=name,
                unit=VARIABLES[name].unit,
                transform=transforms[j],
                mean=float(mean[j]),
                scale=float(scale[j]),
                lower=float(lower),
                upper=float(upper),
            )
        )
    return tuple(columns)


def _trained_range(values: FloatArray) -> tuple[float, float]:
    """Range of values with five strata of their design outwards, never across 0.

    The samples of a Latin hypercube keep off the ends of the range they are drawn from, and some of
    the outermost are no training rows; but the ends are what people ask for: no tensile strength,
    a vertical face.
    """
    least, most = float(values.min()), float(values.max())
    # At the least a hair, so that rounding of a linear rule keeps every training row inside.
    margin = max(5.0 * (most - least) / len(values), 1e-9)
    lower, upper = least - margin, most + margin
    return max(lower, 0.0) if least >= 0.0 else lower, min(upper, 0.0) if most <= 0.0 else upper


def domain_constraints(table: Table) -> tuple[Constraint, ...]:
    """Rules of the domain that no box of single inputs can say, read off the training rows.

    Charge length, bench height and burden are tied: what the charge leaves of the hole is its
    stemming, and that was only trained between two multiples of the burden, the charge between two
    shares of the bench. A charge was never shorter than some multiple of its diameter. Spacing
    went with the burden and tensile strength with the compressive one.
    """
    rules = []
    for label, parts, base, two_sided in _RATIOS:
        if not {*parts, base} <= set(table.feature_names):
            continue
        train = table.frame.iloc[table.rows("train")]
        ratio = sum(c * train[name] for name, c in parts.items()) / train[base]
        least, most = _trained_range(ratio.to_numpy())
        shown, unit = base.replace("_", " "), VARIABLES[base].unit
        rules.append(
            Constraint(f"{label} at least {least:.3g} {shown}", {**parts, base: -least}, 0.0, unit)
        )
        if two_sided:
            negative = {name: -c for name, c in parts.items()}
            rules.append(
                Constraint(
                    f"{label} at most {most:.3g} {shown}", {**negative, base: most}, 0.0, unit
                )
            )
    return tuple(rules)
