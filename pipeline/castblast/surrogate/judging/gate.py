"""Physics gate: what every answer of a surrogate must obey, asked all over the joint domain.

`probe.physics_probe` runs the simulator once per dataset; `check_physics` asks a surrogate there
and on a dense low-discrepancy grid. A surrogate is only asked what the physics of this code does:
a rule that the simulator itself breaks is stated and not asked.

A slope is wrong where the surrogate has none, or one of the other sign, while the simulator's is
clear (`Pairs.clear`); and on the dense grid, where the simulator was not run, where the surrogate
has a clear slope of the other sign.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import pi
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from castblast.design.variables import VARIABLES
from castblast.disk.plain import finite
from castblast.surrogate.fitting import estimators
from castblast.surrogate.fitting.training import Fit
from castblast.surrogate.judging.domain import Domain, Points
from castblast.surrogate.judging.probe import VELOCITY, Pairs, Probe
from castblast.types import FloatArray

#: Frame of features and ``explosive`` to targets (n, m), SI.
Predict: TypeAlias = Callable[[Any], FloatArray]

#: Answers beyond the simulated range by this share of its logarithmic width blow up between the
#: rows; the few simulated points do not reach the very ends of the domain.
_BLOW_UP = 0.25
_CHUNK = 4096
#: Energies per metre of hole and per hole that are shares of the energy of the charge.
_PER_METRE = (
    "gas_work", "kinetic_energy", "elastic_energy", "plastic_work", "viscous_work", "gas_energy",
)  # fmt: skip
_PER_HOLE = ("burden_kinetic_energy", "fracture_work", "vented_enthalpy")


class Surrogate(NamedTuple):
    """A trained model as the judges see it.

    Attributes
    ----------
    predict : callable
        Frame with `features` [SI] and ``explosive`` to (n, m) [SI].
    features : sequence of str
        Numeric inputs.
    targets : sequence of str
    """

    predict: Predict
    features: Sequence[str]
    targets: Sequence[str]

    def answers(self, domain: Domain, points: Points) -> dict[str, FloatArray]:
        """Predictions by target at points of a domain, in blocks."""
        frame = domain.frame(points, self.features)
        blocks = [frame.iloc[i : i + _CHUNK] for i in range(0, len(frame), _CHUNK)]
        values = np.concatenate([self.predict(block) for block in blocks])
        return {name: values[:, j] for j, name in enumerate(self.targets)}


def fit_surrogate(fit: Fit) -> Surrogate:
    """Give a fit as a `Surrogate`."""
    return Surrogate(
        lambda frame: estimators.predict(fit.estimator, frame),
        fit.table.feature_names,
        fit.table.target_names,
    )


class _Rule(NamedTuple):
    """`margin` (n,) must not be negative; `say` puts it into words."""

    name: str
    say: str
    margin: FloatArray


def check_physics(fit: Fit | Surrogate, probe: Probe) -> dict[str, Any]:
    """Ask a surrogate.

    Parameters
    ----------
    fit : Fit or Surrogate
    probe : Probe
        Of the domain of its dataset.

    Returns
    -------
    dict
        Plain JSON values: ``passed`` (bool), ``reasons`` (list of str, empty if passed) and
        ``checks``, each with name, says, asked (number), broken (number), worst (None, or the place
        of the worst answer with its inputs in SI) and, where it was not asked, why.
    """
    surrogate = fit if isinstance(fit, Surrogate) else fit_surrogate(fit)
    with np.errstate(all="ignore"):  # a model may answer NaN; that is what is to be found
        checks = [*_rule_checks(surrogate, probe), *_sign_checks(surrogate, probe)]
    reasons = [
        f"{check['name']}: {check['broken']} of {check['asked']} answers are wrong"
        for check in checks
        if check["broken"]
    ]
    return {"passed": not reasons, "reasons": reasons, "checks": checks}


def _rule_checks(surrogate: Surrogate, probe: Probe) -> Iterator[dict[str, Any]]:
    """Rules on single answers, on the dense grid."""
    answers = surrogate.answers(probe.domain, probe.dense)
    truth = {name: probe.outputs[name] for name in surrogate.targets}
    simulated = {rule.name: rule for rule in _rules(truth, probe.domain, probe.points, probe)}
    for rule in _rules(answers, probe.domain, probe.dense, probe):
        kept = bool(np.all(simulated[rule.name].margin >= 0.0))
        if not kept:
            yield _not_asked(rule.name, rule.say, "the simulator itself breaks it")
            continue
        bad = ~(rule.margin >= 0.0)  # NaN breaks a rule
        worst = int(np.argmin(np.where(np.isnan(rule.margin), -np.inf, rule.margin)))
        spot = _spot(probe.domain, probe.dense, worst, answers) if bad.any() else None
        yield _check(rule.name, rule.say, len(bad), int(bad.sum()), spot)


def _rules(
    answers: Mapping[str, FloatArray], domain: Domain, points: Points, probe: Probe
) -> Iterator[_Rule]:
    inputs, radius = points.inputs, 0.5 * points.inputs["hole_diameter"]
    for name, values in answers.items():
        truth = probe.outputs[name]
        if truth.min() > 0.0:
            yield _Rule(f"{name} is positive", "a finite number above 0", _finite(values))
            slack = (truth.max() / truth.min()) ** _BLOW_UP
            low, high = truth.min() / slack, truth.max() * slack
            margin = np.minimum(values - low, high - values)
            shown = f"{VARIABLES[name].show(float(low))} to {VARIABLES[name].show(float(high))}"
            yield _Rule(f"{name} does not blow up", f"all that is simulated, and more: {shown}",
                        margin)  # fmt: skip
        if VARIABLES[name].unit == "1" and VARIABLES[name].upper == 1.0:
            yield _Rule(f"{name} is a share", "0 to 1", np.minimum(values, 1.0 - values))
    pressure, hole = answers.get("equilibrium_pressure"), answers.get("expanded_hole_radius")
    crushed = answers.get("crushed_zone_radius")
    ceiling = _explosion_pressure(probe, points)
    if pressure is not None and ceiling is not None:
        yield _Rule("equilibrium below explosion pressure",
                    "the gas only expands", ceiling - pressure)  # fmt: skip
    if hole is not None:
        yield _Rule("the hole does not shrink", "expanded radius at least that of the hole",
                    hole - radius)  # fmt: skip
    if crushed is not None and hole is not None:
        yield _Rule("the crushed zone holds the hole", "crushed zone beyond the expanded hole",
                    crushed - hole)  # fmt: skip
    yield from _energy_rules(answers, domain, points)
    if VELOCITY in answers:
        share = _burden_mass(inputs) * answers[VELOCITY] ** 2 / (2.0 * _charge(domain, points)[1])
        yield _Rule("kinetic energy below the charge's",
                    "burden mass v² / 2 at most the heat of explosion", 1.0 - share)  # fmt: skip


def _energy_rules(
    answers: Mapping[str, FloatArray], domain: Domain, points: Points
) -> Iterator[_Rule]:
    per_metre, per_hole = _charge(domain, points)
    for names, energy in ((_PER_METRE, per_metre), (_PER_HOLE, per_hole)):
        for name in names:
            if name in answers:
                share = answers[name] / energy
                yield _Rule(f"{name} is a share of the charge's energy", "0 to 1",
                            np.minimum(share, 1.0 - share))  # fmt: skip


def _finite(values: FloatArray) -> FloatArray:
    return np.where(np.isfinite(values), values, -np.inf)


def _charge(domain: Domain, points: Points) -> tuple[FloatArray, FloatArray]:
    """Heat of explosion of the charge: (n,) [J m-1] and (n,) [J]."""
    area = 0.25 * pi * points.inputs["charge_diameter"] ** 2
    per_metre = domain.energy[points.explosive] * area
    return per_metre, per_metre * points.inputs["charge_length"]


def _burden_mass(inputs: Mapping[str, FloatArray]) -> FloatArray:
    """Mass of rock per hole [kg], toe burden included."""
    height = inputs["bench_height"]
    mean = inputs["burden"] + 0.5 * height / np.tan(inputs["face_angle"])
    return inputs["rock_density"] * inputs["spacing"] * height * mean


def _explosion_pressure(probe: Probe, points: Points) -> FloatArray | None:
    """Explosion pressure at points, where it follows from the explosive alone, else None."""
    if points is probe.points:
        return probe.outputs["explosion_pressure"]
    ratio = probe.points.inputs["charge_diameter"] / probe.points.inputs["hole_diameter"]
    if np.ptp(ratio) > 1e-9:
        return None
    table = np.full(len(probe.domain.explosives), np.inf)
    table[probe.points.explosive] = probe.outputs["explosion_pressure"]
    return table[points.explosive]


def _sign_checks(surrogate: Surrogate, probe: Probe) -> Iterator[dict[str, Any]]:
    """Signs of the slope of the burden velocity."""
    if VELOCITY not in surrogate.targets:
        return
    for pairs, dense in zip(probe.pairs, probe.dense_pairs, strict=True):
        direction = pairs.direction
        if direction.sign == 0:
            continue
        verb = "rises" if direction.sign > 0 else "falls"
        if np.any(dense.sign * direction.sign < 0.0):
            verb = "goes by the powder factor"
        name = f"{VELOCITY} {verb} with {direction.name}"
        held = f"held: {direction.held}" if direction.held else "all else held"
        if not pairs.kept:
            yield _not_asked(name, held, "the simulator itself breaks it")
        elif not _answers_to(surrogate, pairs):
            yield _not_asked(name, held, f"{direction.name} is no input of this model")
        else:
            yield _sign_check(surrogate, probe.domain, name, held, pairs, dense)


def _sign_check(
    surrogate: Surrogate, domain: Domain, name: str, held: str, pairs: Pairs, dense: Pairs
) -> dict[str, Any]:
    """Count wrong slopes where the simulator's is known, and clearly wrong ones elsewhere."""
    clear = pairs.clear
    known = (pairs.sign * pairs.slope) > clear
    slopes = _slopes(surrogate, domain, pairs)
    missing = known & ~(pairs.sign * slopes > 0.0)
    required = dense.sign != 0.0
    dense_slopes = _slopes(surrogate, domain, dense)
    wrong = required & ~(dense.sign * dense_slopes > -clear)
    spot = None
    if missing.any() or wrong.any():
        places, found, sign = (
            (dense.at, dense_slopes, dense.sign)
            if wrong.any()
            else (pairs.at, slopes, np.where(known, pairs.sign, 0.0))
        )
        worst = int(np.argmin(np.where(sign != 0.0, np.nan_to_num(sign * found, nan=-1e9), 1e9)))
        spot = _spot(domain, places, worst, {"slope": found})
    return {
        **_check(name, held, int(known.sum() + required.sum()),
                 int(missing.sum() + wrong.sum()), spot),
        "clear_slope": clear,
        "least_slope": finite(float(np.min((dense.sign * dense_slopes)[required]))),
    }  # fmt: skip


def _answers_to(surrogate: Surrogate, pairs: Pairs) -> bool:
    """Whether a step moves any of the inputs of a surrogate."""
    low, high = pairs.low.inputs, pairs.high.inputs
    return any(np.any(low[name] != high[name]) for name in surrogate.features)


def _slopes(surrogate: Surrogate, domain: Domain, pairs: Pairs) -> FloatArray:
    low, high = (surrogate.answers(domain, end)[VELOCITY] for end in (pairs.low, pairs.high))
    # A velocity of 0 or below has no logarithm: NaN, which is wrong.
    return np.asarray(np.log(high / low) / pairs.step)


def _spot(
    domain: Domain, points: Points, row: int, answers: Mapping[str, FloatArray]
) -> dict[str, Any]:
    inputs = {name: float(points.inputs[name][row]) for name in domain.sampled}
    found = {name: float(values[row]) for name, values in answers.items()}
    return {
        "explosive": domain.explosives[int(points.explosive[row])],
        "inputs": inputs,
        "answers": finite(found),
    }


def _check(
    name: str, says: str, asked: int, broken: int, worst: dict[str, Any] | None
) -> dict[str, Any]:
    return {"name": name, "says": says, "asked": asked, "broken": broken, "worst": worst}


def _not_asked(name: str, says: str, why: str) -> dict[str, Any]:
    return {**_check(name, says, 0, 0, None), "not_asked": why}
