"""The catalogue of explosives: list, describe, check, and refuse what does not hold together."""

from __future__ import annotations

from typing import Any

from castblast.explosive.cj import volume_at_pressure, work_to_pressure
from castblast.explosive.finding import rejected, warned
from castblast.explosive.isentrope import energy, in_hole_velocity, pressure, slope
from castblast.specs.explosive import load_explosive
from castblast.stages.outcome import Outcome

#: Pressures [Pa] down to which the work of the products is shown.
WORK_PRESSURES = (1e8, 2e7, 1e5)
#: Relative volumes at which the exponent of the isentrope is shown.
SLOPE_VOLUMES = (1.0, 2.0, 3.3, 10.0)
#: Hole diameter [m] at which the in-hole velocity is shown.
SHOWN_DIAMETER = 0.15


def describe(name_or_path: str) -> dict[str, Any]:
    """States and energies of an explosive in SI units, and where its numbers come from.

    Raises
    ------
    SpecError
        Unknown name, or faults of the file.
    """
    spec = load_explosive(name_or_path)
    explosive, state = spec.to_explosive(), spec.cj_state()
    # The curve of an inconsistent set may turn negative and then reaches no pressure at all.
    reached = () if rejected(spec.check()) else WORK_PRESSURES
    isentrope = explosive.isentrope
    at_cj = (
        {}
        if state is None
        else {
            "cj_pressure": state.pressure,
            "cj_relative_volume": state.relative_volume,
            "cj_gamma": state.gamma,
        }
    )
    return {
        "name": spec.name,
        "form": "table" if isentrope.tabulated else "JWL",
        "density": spec.density,
        "detonation_velocity": spec.detonation_velocity,
        "in_hole_velocity_150_mm": in_hole_velocity(explosive, SHOWN_DIAMETER),
        "heat_of_explosion": spec.heat_of_explosion,
        "total_energy": explosive.total_energy,
        "energy_at_explosion_state": energy(isentrope, 1.0),
        "cj_pressure": None,
        **at_cj,
        "explosion_pressure": pressure(isentrope, 1.0),
        "constant_volume_pressure": spec.constant_volume_pressure(),
        "work": {f"{p * 1e-6:g} MPa": work_to_pressure(explosive, p) for p in reached},
        "relative_volume": {f"{p * 1e-6:g} MPa": volume_at_pressure(isentrope, p) for p in reached},
        "exponent": {f"V = {v:g}": slope(isentrope, v) for v in SLOPE_VOLUMES},
        "source": spec.source,
        "derived": list(spec.derived),
        "notes": spec.notes,
    }


def check_explosive(name_or_path: str) -> Outcome:
    """Hold the numbers of an explosive against each other; does not raise on a failed relation.

    Raises
    ------
    SpecError
        Unknown name, or faults of the file.
    """
    spec = load_explosive(name_or_path)
    findings = spec.check()
    failed = [f"{spec.name}: {finding}" for finding in rejected(findings)]
    mends = [f"{spec.name}: {line}" for line in spec.remedies()] if failed else []
    verdict = (
        "inconsistent" if failed else "usable, with warnings" if warned(findings) else "consistent"
    )
    return Outcome(
        title=f"{spec.name}: {verdict}",
        header=("relation", "value", "allowed", "verdict"),
        rows=[(f.relation, f.shown_value, f.limit, f.level.value) for f in findings],
        remarks=mends,
        faults=failed,
        ok=not failed,
        document={
            "name": spec.name,
            "verdict": verdict,
            "findings": [{**f._asdict(), "level": f.level.value} for f in findings],
            "remedies": mends,
        },
    )
