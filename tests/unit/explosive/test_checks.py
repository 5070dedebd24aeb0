"""The checks of an explosive: published sets that hold, mixed sets and slips of units."""

from __future__ import annotations

import numpy as np
import pytest

from castblast.explosive.checks import check_jwl
from castblast.explosive.cj import JwlSet, complete_jwl, own_cj_state
from castblast.explosive.finding import Finding, Level, rejected, warned
from castblast.explosive.isentrope import pressure
from castblast.explosive.table_checks import check_table
from castblast.specs.catalogue import explosive_names
from castblast.specs.explosive import load_explosive

GPA = 1e9


def jwl(rho: float, d: float, p: float | None, a: float, b: float, r1: float, r2: float,
        w: float, e0: float | None, c: float | None = None) -> JwlSet:  # fmt: skip
    """A JWL set with pressures in GPa."""
    si = [None if x is None else x * GPA for x in (c, e0, p)]
    return JwlSet(rho, d, a * GPA, b * GPA, r1, r2, w, *si)


# Sets of the literature: AUTODYN material library, LLNL (TNT), a set common in rock blasting.
AUTODYN_ANFO = jwl(931, 4160, 5.15, 49.46, 1.891, 3.907, 1.118, 0.3333, 2.484)
TNT = jwl(1630, 6930, 21.0, 371.2, 3.231, 4.15, 0.95, 0.30, 7.0)
ROCK_EMULSION = jwl(1300, 5500, 9.9, 214.4, 0.182, 4.2, 0.9, 0.15, 4.192)
# The same with another detonation state, or a unit slip in B; presets that mix two sources.
OTHER_STATE = ROCK_EMULSION._replace(detonation_velocity=4000.0, cj_pressure=5.2 * GPA)
SLIP_IN_B = ROCK_EMULSION._replace(b=18.2 * GPA)
MIXED_ANFO = jwl(930, 4700, None, 49.46, 1.891, 4.10, 1.15, 0.33, 3.7 * 0.930)
MIXED_ALUMINIZED = jwl(1050, 4900, None, 76.5, 1.85, 4.15, 1.15, 0.30, 4.1 * 1.050)
BROKEN = {
    "other state": OTHER_STATE,
    "slip in B": SLIP_IN_B,
    "mixed anfo": MIXED_ANFO,
    "mixed aluminized": MIXED_ALUMINIZED,
}


def named(findings: list[Finding], start: str) -> Finding:
    return next(f for f in findings if f.relation.startswith(start))


@pytest.mark.parametrize("name", explosive_names())
def test_catalogue_is_consistent(name: str) -> None:
    spec = load_explosive(name)
    findings = spec.check()
    assert all(f.level is Level.OK for f in findings)
    assert abs(named(findings, "tangency").value) < 0.1
    assert abs(named(findings, "Hugoniot").value) < 0.3
    own, velocity = own_cj_state(spec.jwl_set(), spec.jwl.E0)
    assert velocity == pytest.approx(spec.detonation_velocity, abs=2.0)
    assert own.pressure == pytest.approx(spec.cj_pressure, rel=1e-3)


@pytest.mark.parametrize(
    ("jwl_set", "c", "tangency", "hugoniot"),
    [(AUTODYN_ANFO, 0.479, -0.1, 0.1), (TNT, 1.048, 0.0, 0.1), (ROCK_EMULSION, 0.395, 1.2, -9.0)],
)
def test_published_sets_are_usable(
    jwl_set: JwlSet, c: float, tangency: float, hugoniot: float
) -> None:
    findings = check_jwl(jwl_set, heat_of_explosion=jwl_set.total_energy / jwl_set.density)
    assert not rejected(findings)
    assert named(findings, "tangency").value == pytest.approx(tangency, abs=0.06)
    assert named(findings, "Hugoniot").value == pytest.approx(hugoniot, abs=0.06)
    assert complete_jwl(jwl_set).isentrope.c == pytest.approx(c * GPA, rel=2e-3)


def test_rock_emulsion_is_usable_with_a_warning_about_its_energy() -> None:
    findings = check_jwl(ROCK_EMULSION, heat_of_explosion=3.3e6)
    assert [f.relation[:8] for f in warned(findings)] == ["Hugoniot"]
    _, velocity = own_cj_state(ROCK_EMULSION, ROCK_EMULSION.total_energy)
    assert velocity == pytest.approx(5521.0, abs=1.0)


def test_another_detonation_state_fails_the_tangency() -> None:
    findings = check_jwl(OTHER_STATE, heat_of_explosion=3.3e6)
    assert named(findings, "tangency").value == pytest.approx(56.0, abs=0.5)
    assert named(findings, "tangency").level is Level.REJECT
    assert named(findings, "C positive").level is Level.REJECT


def test_unit_slip_makes_c_negative() -> None:
    findings = check_jwl(SLIP_IN_B, heat_of_explosion=3.3e6)
    assert named(findings, "C positive").value < 0.0
    assert named(findings, "C positive").level is Level.REJECT


def stated_with(jwl_set: JwlSet, fields: str) -> JwlSet:
    """The set as a file may state it: with C, E0 or P_CJ, worked out as its author would."""
    pressure_from_gamma = jwl_set.density * jwl_set.detonation_velocity**2 / 4.0
    p = jwl_set.cj_pressure or pressure_from_gamma
    c = complete_jwl(jwl_set._replace(cj_pressure=p)).isentrope.c
    return jwl_set._replace(
        c=c if "c" in fields else None,
        total_energy=jwl_set.total_energy if "e" in fields else None,
        cj_pressure=p if "p" in fields else None,
    )


@pytest.mark.parametrize("fields", ["c", "e", "p", "ce", "cp", "ep", "cep"])
@pytest.mark.parametrize("name", BROKEN)
def test_mixed_sets_are_refused_however_they_are_stated(name: str, fields: str) -> None:
    findings = check_jwl(stated_with(BROKEN[name], fields), heat_of_explosion=3.7e6)
    failed = rejected(findings)
    assert failed
    assert all(np.isfinite(f.value) for f in failed)


@pytest.mark.parametrize("fields", ["c", "e", "p", "ce", "cp", "ep", "cep"])
def test_a_good_set_passes_however_it_is_stated(fields: str) -> None:
    for good in (AUTODYN_ANFO, TNT):
        assert not rejected(check_jwl(stated_with(good, fields), 4.0e6))


@pytest.mark.parametrize("factor", [0.01, 0.1, 10.0, 100.0])
@pytest.mark.parametrize("field", ["a", "b", "c", "total_energy", "cj_pressure", "density"])
def test_a_slip_of_units_in_any_field_is_seen(field: str, factor: float) -> None:
    """A factor 10 or 100 (kbar, Mbar) in one field of a good, fully stated set.

    B of ANFO carries little at the CJ state: a tenth of it passes only with a warning.
    """
    good = load_explosive("anfo").jwl_set()
    slipped = good._replace(**{field: getattr(good, field) * factor})
    findings = check_jwl(slipped, heat_of_explosion=3.75e6)
    assert rejected(findings) or (field == "b" and warned(findings))


def test_swapped_exponents_are_named() -> None:
    swapped = TNT._replace(r1=TNT.r2, r2=TNT.r1)
    assert [f.relation for f in rejected(check_jwl(swapped, 4e6))] == ["R1 above R2"]


# ------------------------------------------------------------------------------------- tables
STATE = {"density": 800.0, "detonation_velocity": 4806.0, "heat_of_explosion": 3.75e6}


def anfo_table() -> tuple[np.ndarray, np.ndarray]:
    isentrope = load_explosive("anfo").to_explosive().isentrope
    volume = np.geomspace(0.7, 200.0, 30)
    return volume, np.array([pressure(isentrope, float(v)) for v in volume])


def failed_relations(volume: np.ndarray, p: np.ndarray, **state: float) -> str:
    return " ".join(f.relation for f in rejected(check_table(volume, p, None, **(STATE | state))))


def test_good_table_passes() -> None:
    volume, p = anfo_table()
    assert failed_relations(volume, p) == ""
    assert failed_relations(volume, p, cj_pressure=4.997e9) == ""


def test_faulty_rows_are_numbered() -> None:
    volume, p = anfo_table()
    p[16] = p[15] * 1.01
    finding = next(f for f in rejected(check_table(volume, p, None, **STATE)))
    assert "P falling" in finding.relation
    assert finding.value == 17


@pytest.mark.parametrize(
    ("spoil", "relation"),
    [
        (lambda v, p: (v[:8], p[:8]), "rows of the table"),
        (lambda v, p: (v[::-1], p), "V rising"),
        (lambda v, p: (v, -p), "positive"),
        (lambda v, p: (v[v > 1.5], p[v > 1.5]), "first relative volume"),
        (lambda v, p: (v[:15], p[:15]), "last pressure"),
        (lambda v, p: (v, np.where(np.arange(30) == 12, p * 1.12, p)), "convex"),
        (lambda v, p: (v, p * 1e-6), "CJ state"),
        (lambda v, p: (v, p[0] * (v / v[0]) ** -0.9), "smallest exponent"),
        (lambda v, p: (v, p[0] * (v / v[0]) ** -6.5), "largest exponent"),
    ],
)
def test_spoilt_tables_are_refused(spoil: object, relation: str) -> None:
    assert relation in failed_relations(*spoil(*anfo_table()))


def test_energy_column_must_be_the_integral() -> None:
    volume, p = anfo_table()
    isentrope = load_explosive("anfo").to_explosive().isentrope
    from castblast.explosive.isentrope import energy

    e = np.array([energy(isentrope, float(v)) for v in volume])
    assert not rejected(check_table(volume, p, e, **STATE))
    assert "energy column" in rejected(check_table(volume, p, e * 1.1, **STATE))[0].relation
