"""Which way the burden velocity moves with each input: the simulator's own answer over a domain.

A direction says what is changed and what is held. Its sign is what the physics of this code does;
`physics_probe` verifies that on pairs of simulated points, and a surrogate is only asked for signs
that the simulator keeps.

One sign depends on the place. A higher bench with the same stemming has a longer charge, but
before an inclined face also more toe burden. The velocity follows the powder factor
m / (rho S B_m H), B_m = B + (H / 2) cot(face angle): its logarithmic slope in H at constant
stemming L_s is

    L_s / L_c  -  (H / 2) cot(face angle) / B_m

and the velocity rises where that is clearly positive and falls where it is clearly negative
(derived by this project; over the full recipe the two slopes correlate with 0.999).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from castblast.progress import ProgressCallback, silent
from castblast.surrogate.judging.domain import Domain, Points
from castblast.types import FloatArray

#: The output that the directions are about.
VELOCITY = "burden_velocity"
#: Points are moved by this factor up and down.
STEP = 1.03
#: A slope is clear where it exceeds this share of the median of its direction.
CLEAR_SHARE = 0.1
#: Slopes of the powder factor beyond which a higher bench is clearly faster, or slower.
_FASTER, _SLOWER = 0.05, -0.1


class Direction(NamedTuple):
    """One way to change a design.

    Attributes
    ----------
    name : str
        The input that is changed.
    sign : int
        Sign of the change of velocity; 0: not monotone, so nothing is required.
    held : str
        What stays, where that is not plain.
    """

    name: str
    sign: int
    held: str = ""


DIRECTIONS = (
    Direction("ucs", 1, "tensile strength"),
    Direction("young_modulus", 1),
    Direction("friction_angle", 0),
    Direction("rock_density", -1),
    Direction("hole_diameter", 1, "charge length; the charge fills the hole as before"),
    Direction("burden", -1, "stemming and charge length; spacing unless it is tied to the burden"),
    Direction("spacing", -1),
    Direction("bench_height", 1, "stemming length; sign of the powder factor"),
    Direction("stemming_length", -1, "bench height, so the charge is shorter"),
    Direction("face_angle", 1, "crest burden"),
)


@dataclass(frozen=True, eq=False)
class Pairs:
    """Points a step apart in one direction.

    Attributes
    ----------
    direction : Direction
    low, high : Points, n of each
    at : Points
        Where the pair is about.
    step : (n,)
        Difference of the logarithms of the input.
    sign : (n,)
        Required sign of the slope; 0 where none is.
    slope : (n,)
        d ln v / d ln input of the simulator; empty where it was not run.
    """

    direction: Direction
    low: Points
    high: Points
    at: Points
    step: FloatArray
    sign: FloatArray
    slope: FloatArray

    @property
    def clear(self) -> float:
        """Slope from which on a response counts: a share of the median of the true ones."""
        return CLEAR_SHARE * float(np.median(np.abs(self.slope))) if len(self.slope) else 0.0

    @property
    def kept(self) -> bool:
        """The simulator has the required sign wherever its slope is clear."""
        clear = np.abs(self.slope) > self.clear
        return bool(np.all(self.sign[clear] * self.slope[clear] >= 0.0))

    def to_document(self) -> dict[str, Any]:
        """Give what the simulator does in this direction as plain JSON values."""
        required = self.sign != 0.0
        wrong = required & (self.sign * self.slope <= 0.0)
        low, middle, high = np.quantile(self.slope, (0.0, 0.5, 1.0)).tolist()
        return {
            "input": self.direction.name,
            "sign": self.direction.sign,
            "held": self.direction.held,
            "pairs": self.at.size,
            "sign_required": int(required.sum()),
            "simulator_breaks_sign": int(wrong.sum()),
            "simulator_slope": {"least": low, "median": middle, "most": high},
            "rising_share": float(np.mean(self.slope > 0.0)),
            "clear_slope": self.clear,
            "asked": self.direction.sign != 0 and self.kept,
        }


@dataclass(frozen=True, eq=False)
class Probe:
    """What the gate knows of a domain.

    Attributes
    ----------
    domain : Domain
    points : Points
        Where the simulator was run.
    outputs : mapping of output name to (n,) [SI]
        Of the simulator there.
    pairs : tuple of Pairs
        Of these points, with true slopes; one for every direction the recipe can move in.
    dense : Points
    dense_pairs : tuple of Pairs
        Of the dense points, without slopes, in the order of `pairs`.
    """

    domain: Domain
    points: Points
    outputs: Mapping[str, FloatArray]
    pairs: tuple[Pairs, ...]
    dense: Points
    dense_pairs: tuple[Pairs, ...]

    def to_document(self) -> dict[str, Any]:
        """Give what the simulator does, per direction, as plain JSON values."""
        return {
            "target": VELOCITY,
            "points": self.points.size,
            "dense_points": self.dense.size,
            "step": STEP,
            "directions": [pairs.to_document() for pairs in self.pairs],
        }


def physics_probe(
    domain: Domain,
    points: int = 512,
    dense: int = 8192,
    seed: int = 0,
    progress: ProgressCallback = silent,
) -> Probe:
    """Run the simulator on pairs of points and draw the dense grid; once per dataset.

    Parameters
    ----------
    domain : Domain
    points : int
        Points where the true response is simulated, about 20 runs of 1.3 ms each; 128 will do
        for a quick look.
    dense : int
        Points where a surrogate is asked; scrambled Sobol points, as the others.
    seed : int
    progress : callable
    """
    grid = domain.spread(points, seed)
    directions = [entry for entry in DIRECTIONS if _moves(domain, entry)]
    outputs = domain.simulate(grid, domain.simulator.output_names)
    finished = np.flatnonzero(np.isfinite(outputs).all(axis=1))
    grid, outputs = grid.take(finished), outputs[finished]
    pairs = []
    for number, direction in enumerate(directions):
        progress(number / len(directions), f"physics gate: simulator along {direction.name}")
        pairs.append(_with_slopes(domain, make_pairs(domain, grid, direction)))
    everywhere = domain.spread(dense, seed + 1)
    dense_pairs = tuple(make_pairs(domain, everywhere, direction) for direction in directions)
    names = domain.simulator.output_names
    by_name = {name: outputs[:, j] for j, name in enumerate(names)}
    progress(1.0, "physics gate: simulator done")
    return Probe(
        domain=domain,
        points=grid,
        outputs=by_name,
        pairs=tuple(pairs),
        dense=everywhere,
        dense_pairs=dense_pairs,
    )


def make_pairs(domain: Domain, points: Points, direction: Direction) -> Pairs:
    """Move points up and down; at the edge of the domain one end is the point itself."""
    ends, inside = [], []
    for factor in (1.0 / STEP, STEP):
        moved, stays = domain.moved(points, _changes(domain, points, direction, factor))
        ends.append(moved)
        inside.append(stays)
    rows = np.flatnonzero(inside[0] | inside[1])
    low, high, at = (part.take(rows) for part in (*ends, points))
    step = np.log(high.inputs[direction.name] / low.inputs[direction.name])
    sign = _required_sign(direction, at)
    return Pairs(
        direction=direction, low=low, high=high, at=at, step=step, sign=sign, slope=np.empty(0)
    )


def _with_slopes(domain: Domain, pairs: Pairs) -> Pairs:
    low, high = (domain.simulate(end, (VELOCITY,))[:, 0] for end in (pairs.low, pairs.high))
    rows = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
    return Pairs(
        pairs.direction,
        low=pairs.low.take(rows),
        high=pairs.high.take(rows),
        at=pairs.at.take(rows),
        step=pairs.step[rows],
        sign=pairs.sign[rows],
        slope=np.log(high[rows] / low[rows]) / pairs.step[rows],
    )


def _moves(domain: Domain, direction: Direction) -> bool:
    """Whether the recipe varies what this direction changes."""
    sampled = set(domain.sampled)
    if direction.name == "stemming_length":
        return bool(sampled & {"stemming_length", "charge_length"})
    return direction.name in sampled


def _changes(
    domain: Domain, points: Points, direction: Direction, factor: float
) -> dict[str, FloatArray]:
    """Variables of the recipe that a step of a direction changes."""
    inputs, variables = points.inputs, domain.recipe.variables
    name, charge_given = direction.name, "charge_length" in variables
    if name == "stemming_length" and "stemming_length" not in variables:
        return {"charge_length": inputs["bench_height"] - factor * inputs["stemming_length"]}
    changes = {name: factor * inputs[name]}
    if name == "bench_height" and charge_given:
        changes["charge_length"] = changes[name] - inputs["stemming_length"]
    if name == "stemming_length" and charge_given:
        changes["charge_length"] = inputs["bench_height"] - changes[name]
    if name == "hole_diameter" and "charge_diameter" in variables:
        changes["charge_diameter"] = factor * inputs["charge_diameter"]
    return changes


def _required_sign(direction: Direction, points: Points) -> FloatArray:
    if direction.name != "bench_height":
        return np.full(points.size, float(direction.sign))
    inputs = points.inputs
    toe = 0.5 * inputs["bench_height"] / np.tan(inputs["face_angle"])
    rise = inputs["stemming_length"] / inputs["charge_length"] - toe / (inputs["burden"] + toe)
    return np.where(rise > _FASTER, 1.0, np.where(rise < _SLOWER, -1.0, 0.0))
