"""When, how fast and which way each block of a bench is fired."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from castblast.design.hole import charge_length
from castblast.design.rule import complete_columns
from castblast.errors import SpecError
from castblast.muckpile.bench.geometry import Bench, assign_blocks, block_centres, block_velocities
from castblast.muckpile.bench.timing import firing_front_azimuth, nearest_holes, scatter_delays
from castblast.network import Network
from castblast.prediction.answer import predict
from castblast.specs.bench.bench import BenchSpec
from castblast.specs.bench.holes import Holes, blocks_of_holes, read_holes
from castblast.specs.explosive import load_explosive
from castblast.types import FloatArray, IntArray

#: Neighbours of a hole, over the larger of burden and spacing: those beside it and across.
_NEIGHBOURS = 1.5
_KEPT = ("explosive", "burden_velocity", "inputs", "in_domain", "domain", "domain_faults", "model")
_MOST_FAULTS = 5
#: From good to bad.
_VERDICTS = ("inside", "unusual", "outside")
#: A hole that gives one of these says how it is charged: those of the bench are not its own.
_SHARED = frozenset({"stemming_length", "charge_length"})


class Plan(NamedTuple):
    """Firing of a bench, b blocks.

    Attributes
    ----------
    delay : array (b,) [s]
        With the scatter of the detonators; infinite: never fired.
    velocity : array (b, 3) [m s-1]
    speed : float [m s-1]
        Mean over the blocks that are fired.
    prediction : dict, optional
        What the surrogate said.
    holes : array (b, 2), optional [m]
        Only where balls belong to the nearest hole instead of a block of the grid.
    label : sequence of str
        Id of the hole that fires each block, b of them; empty where the holes have none.
    """

    delay: FloatArray
    velocity: FloatArray
    speed: float
    prediction: dict[str, Any] | None = None
    holes: FloatArray | None = None
    label: Sequence[str] = ()

    def blocks_of(self, position: FloatArray, bench: Bench) -> IntArray:
        """Block (n,) of each ball by its place (n, 3) [m]."""
        if self.holes is None:
            return assign_blocks(position, bench)
        return nearest_holes(position, self.holes)


class _Charges(NamedTuple):
    """What fires: one charge per hole, or per block where there is no file of holes."""

    place: FloatArray
    delay: FloatArray
    speed: FloatArray
    azimuth: FloatArray
    elevation: FloatArray


def make_plan(
    spec: BenchSpec,
    bench: Bench,
    folder: Path,
    *,
    one_speed: bool = False,
    network: Network | None = None,
) -> Plan:
    """Work out the firing of a bench.

    Parameters
    ----------
    spec : BenchSpec
    bench : Bench
    folder : Path
        Of the bench file, where its other files lie.
    one_speed : bool
        The velocity of `spec` holds for all, whatever a file of holes says.
    network : Network, optional
        What predicts velocities; default: the one that comes with castblast.

    Raises
    ------
    SpecError
        Faults of the file of holes, or a design that the surrogate cannot take.
    """
    firing = spec.firing
    if firing.holes is None:
        speed, prediction = _common_speed(spec, network)
        delay = firing.block_delay(bench)
        charges = _charges(spec, bench, block_centres(bench), delay, np.full(len(delay), speed))
        return _fire(spec, charges, np.arange(len(delay)), prediction)
    by_block = firing.blocks == "grid"
    holes = read_holes(
        folder / firing.holes,
        bench,
        by_block=by_block,
        frame=spec.frame,
        columns=firing.columns,
    )
    each, prediction = _hole_speeds(spec, holes, network, one_speed=one_speed)
    charges = _charges(spec, bench, holes.place, holes.delay + firing.start, each)
    charges = charges._replace(
        azimuth=np.where(np.isnan(holes.direction), charges.azimuth, holes.direction),
        elevation=np.where(np.isnan(holes.elevation), charges.elevation, holes.elevation),
    )
    if by_block:
        charge = blocks_of_holes(holes, bench)
        label = [holes.label[k] if k >= 0 else "" for k in charge] if holes.label else ()
        return _fire(spec, charges, charge, prediction)._replace(label=label)
    plan = _fire(spec, charges, np.arange(len(holes.delay)), prediction)
    return plan._replace(holes=holes.place, label=holes.label)


def _charges(
    spec: BenchSpec, bench: Bench, place: FloatArray, delay: FloatArray, speed: FloatArray
) -> _Charges:
    azimuth = np.full(len(delay), spec.direction.azimuth)
    if spec.direction.normal_to == "firing_front":
        reach = _NEIGHBOURS * max(bench.burden, bench.spacing)
        azimuth = azimuth + firing_front_azimuth(place, delay, reach)
    return _Charges(place, delay, speed, azimuth, np.full(len(delay), spec.direction.elevation))


def _fire(
    spec: BenchSpec, charges: _Charges, charge: IntArray, prediction: dict[str, Any] | None
) -> Plan:
    """Hand the charges on to the blocks (b,) that they fire; -1: none."""
    delay = charges.delay
    if spec.firing.scatter is not None:
        delay = scatter_delays(
            delay,
            spec.seed,
            relative=spec.firing.scatter.relative,
            absolute=spec.firing.scatter.absolute,
            start=spec.firing.start,
        )
    velocity = block_velocities(
        charges.speed, len(delay), azimuth=charges.azimuth, elevation=charges.elevation
    )
    fired = charge >= 0
    velocity = np.where(fired[:, None], velocity[charge], 0.0)
    delay = np.where(fired, delay[charge], np.inf)
    going = np.isfinite(delay)
    speed = float(np.mean(charges.speed[charge][going])) if going.any() else 0.0
    return Plan(delay, np.ascontiguousarray(velocity), speed, prediction)


def _common_speed(spec: BenchSpec, network: Network | None) -> tuple[float, dict[str, Any] | None]:
    design = spec.design()
    if design is None:
        return spec.velocity or 0.0, None
    try:
        answer = _predict(design, network)
    except SpecError as fault:
        lines = [f"{spec.name}: surrogate: {line}" for line in str(fault).splitlines()]
        raise SpecError("\n".join(lines)) from None
    return answer["burden_velocity"], {key: answer[key] for key in _KEPT} | _velocity_band(answer)


def _predict(design: Mapping[str, Any], network: Network | None) -> dict[str, Any]:
    return predict(_inputs(design), design["explosive"], network)


def _inputs(design: Mapping[str, Any]) -> dict[str, float]:
    return {name: value for name, value in design.items() if name != "explosive"}


def _hole_speeds(
    spec: BenchSpec, holes: Holes, network: Network | None, *, one_speed: bool
) -> tuple[FloatArray, dict[str, Any] | None]:
    """Velocity of each hole: its own, or by its own design, or that of the bench file."""
    own = np.full(len(holes.delay), np.nan) if one_speed else holes.velocity
    speed, faults = own.copy(), []
    design = spec.design()
    answers: dict[str, dict[str, Any]] = {}
    asked = []
    for k in np.flatnonzero(np.isnan(own)):
        if design is None:
            if spec.velocity is None:
                faults.append(
                    f"{holes.where[k]}: velocity: is missing; give it in the file of holes, or "
                    f"'velocity' or 'surrogate' in the bench file"
                )
            else:
                speed[k] = spec.velocity
            continue
        try:
            complete = _charged(design, holes.design[k])
            key = repr(sorted(complete.items()))
            answers[key] = answers.get(key) or _predict(complete, network)
        except SpecError as fault:
            faults += [f"{holes.where[k]}: {line}" for line in str(fault).splitlines()]
            continue
        speed[k] = answers[key]["burden_velocity"]
        asked.append(answers[key])
    if faults:
        raise SpecError("\n".join(faults))
    return speed, _summary(asked)


def _charged(design: Mapping[str, Any], hole: Mapping[str, Any]) -> dict[str, Any]:
    """Design of a hole; how it is charged comes from the hole alone where it says so."""
    own = dict(hole)
    mass = own.pop("charge_mass", None)
    if mass is not None and "charge_length" in own:
        message = "charge_mass and charge_length are both given: one of them is needed"
        raise SpecError(message)
    common = dict(design)
    if mass is not None or not _SHARED.isdisjoint(own):
        common = {name: value for name, value in design.items() if name not in _SHARED}
    full = common | own
    if mass is not None:
        diameter = complete_columns(_inputs(full), 1)["charge_diameter"]
        density = load_explosive(full["explosive"]).density
        full["charge_length"] = charge_length(density, float(diameter[0]), mass)
    return full


def _velocity_band(answer: Mapping[str, Any]) -> dict[str, Any]:
    """What the network says of its own error in the velocity; the same share for all designs."""
    return {"network_band": {"burden_velocity": answer["network_band"]["burden_velocity"]}}


def _summary(answers: list[dict[str, Any]]) -> dict[str, Any] | None:
    """One document for the answers of many holes."""
    if not answers:
        return None
    speeds = [answer["burden_velocity"] for answer in answers]
    faults = dict.fromkeys(line for answer in answers for line in answer["domain_faults"])
    return {
        "explosive": ", ".join(sorted({answer["explosive"] for answer in answers})),
        "burden_velocity": float(np.mean(speeds)),
        "least_burden_velocity": min(speeds),
        "largest_burden_velocity": max(speeds),
        "holes": len(answers),
        **_velocity_band(answers[0]),
        "in_domain": all(answer["in_domain"] for answer in answers),
        "domain": max((answer["domain"] for answer in answers), key=_VERDICTS.index),
        "domain_faults": list(faults)[:_MOST_FAULTS],
        "model": answers[0]["model"],
    }
