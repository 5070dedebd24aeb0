"""A small surrogate of the gas pressure over time and of where the energy goes in the near field.

The histories of a dataset are brought to one dimensionless time, time over the rise time of the
pressure, in which holes of any diameter nearly coincide (the near field has no other length than
the hole; derived by this project). The logarithm of the pressure is written in a few principal
components, and their scores, together with the shares of the energy, are polynomials of the
near-field inputs, one set for each explosive. Bands are split conformal (Lei et al. 2018,
J. Am. Stat. Assoc. 113), on rows that the fit has not seen; so are the errors reported.

The record is plain numbers, so that a page without Python can draw the curve.
"""

from __future__ import annotations

from math import ceil, comb
from typing import TYPE_CHECKING, Any

import numpy as np

from castblast.dataset.file.schema import flag_names, varying_inputs
from castblast.design.variables import VARIABLES
from castblast.errors import DatasetError
from castblast.types import FloatArray

if TYPE_CHECKING:
    import xarray as xr

FORMAT = "castblast history modes"
#: Inputs that the near field sees; logged where they span factors.
_LOGGED = {
    "ucs": True,
    "young_modulus": True,
    "rock_density": True,
    "hole_diameter": True,
    "poisson_ratio": False,
    "friction_angle": False,
    "dilation_angle": False,
    "tensile_strength": False,
    "in_situ_stress": False,
}
#: Parts into which the energy of the explosive goes: name, title, columns of the dataset.
_ENERGY = (
    ("plastic_work", "crushing and shear of the rock", ("plastic_work",)),
    ("elastic_energy", "elastic strain of the rock", ("elastic_energy",)),
    ("kinetic_energy", "motion of the rock in waves", ("kinetic_energy",)),
    ("viscous_work", "shock heating (artificial viscosity)", ("viscous_work",)),
    ("fracture_work", "tension and outer boundary", ("tensile_work", "boundary_work")),
    ("detonation_work", "detonation head and pressure rise", ("head_energy", "ramp_energy")),
    ("gas_energy", "left in the gas", ("gas_energy",)),
)
_POINTS = 48
_MODES = 8
_MOST_TERMS = 300
_RIDGE = 1e-6
_LEVEL = 0.95
_DIGITS = 8


def fit_history_modes(dataset: xr.Dataset) -> dict[str, Any]:
    """Fit pressure histories and energy shares of a dataset.

    Returns
    -------
    dict
        Plain JSON values. A design has the features ``z_i = (x_i or ln x_i - mean_i) / scale_i``;
        term k is the product of ``z_i ** powers[k][i]``; term @ coefficients gives the mode
        scores, then the energy shares of the energy of the explosive (E0, per metre of charge).
        ``ln(p / Pa) = mean + scores @ modes`` at the times ``times`` x rise time, beyond which it
        stays; from time 0 to the rise time the pressure comes up in proportion to time.

    Raises
    ------
    DatasetError
        No histories, or no varied input that the near field sees.
    """
    names = [name for name in _LOGGED if name in varying_inputs(dataset)]
    if "history_pressure" not in dataset.variables or not names:
        message = "the dataset has no pressure histories over near-field inputs"
        raise DatasetError(message)
    good = dataset["status"].to_numpy() == 0
    split = flag_names(dataset["split"])[good]
    kinds = flag_names(dataset["explosive"])[good]
    numeric = np.column_stack([dataset[name].to_numpy()[good] for name in names])
    times, curves = _common_time(dataset, good)
    fit_rows = np.isin(split, ("train", "valid"))
    components, scores = _principal_components(curves, fit_rows)
    targets = np.column_stack([scores, _energy_shares(dataset, good)])
    columns = [_scaling(name, numeric[fit_rows, i]) for i, name in enumerate(names)]
    terms, powers = _polynomial(columns, numeric)
    coefficients = {
        kind: _fit(terms[rows], targets[rows])
        for kind in sorted(set(kinds.tolist()))
        for rows in [fit_rows & (kinds == kind)]
    }
    found = np.empty_like(targets)
    for kind, matrix in coefficients.items():
        found[kinds == kind] = terms[kinds == kind] @ matrix
    mean, modes = components
    off = np.abs(mean + found[:, : len(modes)] @ modes - curves)
    off_shares = np.abs(found - targets)[:, len(modes) :]
    held, seen = split == "test", split == "calibration"
    return {
        "format": FORMAT,
        "dataset": {k: str(dataset.attrs.get(k, "")) for k in ("name", "dataset_version")}
        | {"content_sha256": str(dataset.attrs.get("content_sha256", ""))},
        "inputs": columns,
        "powers": powers.tolist(),
        "coefficients": {kind: _rounded(matrix) for kind, matrix in coefficients.items()},
        "times": _rounded(times),
        "mean": _rounded(mean),
        "modes": _rounded(modes),
        "band": _rounded(_conformal(off[seen])),
        "energy": [
            {"name": name, "title": title, "band": float(f"{half:.6g}")}
            for (name, title, _), half in zip(_ENERGY, _conformal(off_shares[seen]), strict=True)
        ],
        "held_out": {
            "rows": int(held.sum()),
            "pressure_error_50": float(np.expm1(np.quantile(off[held], 0.5))),
            "pressure_error_95": float(np.expm1(np.quantile(off[held], 0.95))),
            "inside_band": float(np.mean(off[held] <= _conformal(off[seen]))),
            "share_error_95": float(np.quantile(off_shares[held], 0.95)),
        },
    }


def _common_time(dataset: xr.Dataset, good: Any) -> tuple[FloatArray, FloatArray]:
    """Dimensionless times (p,), from 1 on, and ln pressure there (n, p).

    The rise is straight and the rest smooth, so only points after the rise are interpolated, by
    a cubic through four points over the root of time, in which the stored points are even.
    """
    rise = dataset["rise_time"].to_numpy()[good]
    end = dataset["history_time"].to_numpy()[good][:, -1].astype(np.float64) / rise
    pressure = dataset["history_pressure"].to_numpy()[good].astype(np.float64)
    log_pressure = np.log(np.maximum(pressure, 1.0))  # 0 at the start, which is not used
    times = np.geomspace(1.0, float(np.quantile(end, 0.9)), _POINTS)
    last = log_pressure.shape[1] - 1
    place = last * np.sqrt(np.minimum(times[None, :] / end[:, None], 1.0))
    after = np.floor(last * np.sqrt(1.0 / end)).astype(int)[:, None] + 1
    first = np.clip(np.floor(place).astype(int) - 1, after, last - 3)
    step = place - first
    rows = np.arange(len(end))[:, None]
    curves = np.zeros_like(place)
    for i in range(4):
        others = [j for j in range(4) if j != i]
        weight = np.prod([(step - j) / (i - j) for j in others], axis=0)
        curves += weight * log_pressure[rows, first + i]
    return times, curves


def _principal_components(
    curves: FloatArray, rows: Any
) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Mean (p,) and modes (m, p) of some rows, and the scores (n, m) of all."""
    from sklearn.decomposition import PCA

    pca = PCA(n_components=_MODES, svd_solver="full").fit(curves[rows])
    return (pca.mean_, pca.components_), np.asarray(pca.transform(curves))


def _energy_shares(dataset: xr.Dataset, good: Any) -> FloatArray:
    """Parts of `_ENERGY` over the energy of the explosive, (n, parts)."""
    kind = dataset["explosive"].to_numpy()[good].astype(int)
    density = dataset["explosive_total_energy"].to_numpy()[kind]
    charge = dataset["charge_diameter"].to_numpy()[good]
    whole = density * np.pi / 4.0 * charge**2
    parts = [
        sum(dataset[name].to_numpy()[good] for name in columns) / whole for _, _, columns in _ENERGY
    ]
    return np.column_stack(parts)


def _scaling(name: str, values: FloatArray) -> dict[str, Any]:
    shown = np.log(values) if _LOGGED[name] else values
    return {
        "name": name,
        "unit": VARIABLES[name].unit,
        "log": _LOGGED[name],
        "mean": float(f"{shown.mean():.6g}"),
        "scale": float(f"{shown.std():.6g}"),
        "lower": float(values.min()),
        "upper": float(values.max()),
    }


def _polynomial(columns: list[dict[str, Any]], numeric: FloatArray) -> tuple[FloatArray, Any]:
    """Terms (n, k) of the highest degree that stays small, and their powers (k, inputs)."""
    from sklearn.preprocessing import PolynomialFeatures

    scaled = np.column_stack(
        [
            ((np.log(x) if c["log"] else x) - c["mean"]) / c["scale"]
            for c, x in zip(columns, numeric.T, strict=True)
        ]
    )
    degree = 2
    while degree < 5 and comb(len(columns) + degree + 1, degree + 1) <= _MOST_TERMS:
        degree += 1
    features = PolynomialFeatures(degree)
    terms = np.asarray(features.fit_transform(scaled), dtype=np.float64)
    return terms, features.powers_


def _fit(terms: FloatArray, targets: FloatArray) -> FloatArray:
    """Coefficients (k, t) by ridge regression; the constant term is free, so shares sum to 1."""
    from sklearn.linear_model import Ridge

    model = Ridge(alpha=_RIDGE * len(terms), solver="cholesky").fit(terms[:, 1:], targets)
    return np.vstack([model.intercept_, model.coef_.T])


def _conformal(off: FloatArray) -> FloatArray:
    """Half band per column (p,): the order statistic that covers a new row at `_LEVEL`."""
    rank = min(ceil(_LEVEL * (len(off) + 1)), len(off)) - 1
    return np.asarray(np.sort(off, axis=0)[rank])


def _rounded(values: FloatArray) -> Any:
    """Nested lists of numbers of `_DIGITS` significant digits."""
    if values.ndim > 1:
        return [_rounded(row) for row in values]
    return [float(f"{value:.{_DIGITS}g}") for value in values.tolist()]
