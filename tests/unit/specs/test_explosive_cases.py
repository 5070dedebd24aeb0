"""Explosive files as people have them: units of hydrocodes, mixed sets, other names of fields."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from castblast.cli import main
from castblast.errors import CheckError, SpecError
from castblast.explosive.finding import rejected
from castblast.specs.explosive import load_explosive, require_consistent
from castblast.specs.units import convert
from castblast.stages.explosives import check_explosive

CASES = Path(__file__).parents[2] / "cases" / "explosives"
UNITS = ("c1_tnt_cmgus", "c1b_tnt_gcc", "c1e_tnt_cal", "c11_mwpa")


def outcome(name: str) -> tuple[str, str, str]:
    """Verdict, failed relations with their fields, and what would fit."""
    found = check_explosive(str(CASES / f"{name}.yaml"))
    return found.document["verdict"], "\n".join(found.faults), "\n".join(found.remarks)


@pytest.mark.parametrize("name", UNITS)
def test_tnt_in_any_units_is_the_tnt_of_si(name: str) -> None:
    """The same verdict on the same numbers, whichever code the file was written for."""
    si, other = (load_explosive(CASES / f"{n}.yaml") for n in ("c0_tnt_si", name))
    assert outcome(name)[0] == outcome("c0_tnt_si")[0] == "consistent"
    assert other.jwl_set()._replace(c=0.0) == pytest.approx(si.jwl_set()._replace(c=0.0), rel=1e-12)
    # 1025 cal/g is 4.2886 MJ/kg.
    assert other.heat_of_explosion == pytest.approx(si.heat_of_explosion, rel=4e-4)


def test_tnt_in_tonnes_millimetres_and_seconds(tmp_path: Path) -> None:
    """4.29e9 mJ/t is a thousandth of what was meant, and is not read as it; 4.29e12 mJ/t is."""
    path = CASES / "c1c_tnt_tonmms.yaml"
    with pytest.raises(SpecError) as caught:
        load_explosive(path)
    assert str(caught.value) == (
        f"{path}: heat_of_explosion: 4.29e9 mJ/t: implausible (4290 J/kg); allowed: 100000 to "
        f"2e+07 J/kg; 1 MJ/kg is 1 kJ/g or 1e12 mJ/t"
    )
    mended = tmp_path / "mended.yaml"
    mended.write_text(path.read_text().replace("4.29e9 mJ/t", "4.29e12 mJ/t"))
    found, si = (load_explosive(p).jwl_set() for p in (mended, CASES / "c0_tnt_si.yaml"))
    assert found._replace(c=0.0) == pytest.approx(si._replace(c=0.0), rel=1e-12)
    assert check_explosive(str(mended)).document["verdict"] == "consistent"


def test_an_energy_per_mass_is_offered_per_volume() -> None:
    with pytest.raises(SpecError) as caught:
        load_explosive(CASES / "c1d_tnt_abaqus_specific.yaml")
    line = str(caught.value)
    assert "E0: 4.29 MJ/kg: is an energy per mass" in line
    assert "times the density of 1630 kg/m3 it is 6.9927 GPa" in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("key", "field"),
    [("w", "omega"), ("E", "E0")],
)
def test_names_of_other_codes_are_hinted_at(key: str, field: str) -> None:
    with pytest.raises(SpecError) as caught:
        load_explosive(CASES / "c10_lowercase_w.yaml")
    assert f"jwl.{key}: unknown key, did you mean '{field}'?" in str(caught.value)


@pytest.mark.parametrize(
    ("key", "field"), [("rho0", "density"), ("VOD", "detonation_velocity"), ("Pcj", "cj_pressure")]
)
def test_symbols_of_books_are_hinted_at(tmp_path: Path, key: str, field: str) -> None:
    content = yaml.safe_load((CASES / "c0_tnt_si.yaml").read_text())
    content[key] = content.pop(field)
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(SpecError, match=f"{key}: unknown key, did you mean '{field}'"):
        load_explosive(path)


VELOCITY = "against density, detonation_velocity"


@pytest.mark.parametrize(
    ("name", "pair", "remedy"),
    [
        ("c2_anfo_A_x10", VELOCITY, "these constants detonate at 9373 m/s, not at 4160 m/s"),
        ("c2b_anfo_A_x10_C", f"jwl.A, B, R1, R2, omega, C {VELOCITY}", ""),
        ("c3_emulsion_is_tnt", VELOCITY, "at 8215 m/s, not at 5500 m/s; are they those of another"),
        ("c4_dynamite", VELOCITY, "are they those of another explosive?"),
        ("c5_anfo_rounded", VELOCITY, "jwl.E0: 3.184 GPa is heat_of_explosion x density"),
        ("c5b_anfo_Jkg_as_Pa", VELOCITY, "jwl.E0: 0.00379 GPa is heat_of_explosion, per mass"),
        ("c5c_anfo_J_per_m3", VELOCITY, "jwl.E0: 3.184 GPa is heat_of_explosion x density"),
        ("c6_hmx", "jwl.E0 against cj_pressure", "would fit: the file without cj_pressure"),
        ("c7_anfo_measured_vod", VELOCITY, "would fit: detonation_velocity 4159 m/s with density"),
        ("c7b_anfo_density_poured", VELOCITY, "would fit: density 930.5 kg/m3 with detonation_vel"),
        ("c8_swapped", "jwl.R1 against jwl.R2", "would fit: jwl.R1 4.15 and jwl.R2 0.95"),
        ("c8b_w_plus_one", "jwl.omega", "would fit: jwl.omega 0.3 instead of 1 + omega = 1.3"),
        ("c9_B_negative", VELOCITY, "these constants detonate at 5703 m/s, not at 4900 m/s"),
    ],
)
def test_mixed_sets_are_refused_with_the_pair_that_does_not_fit(
    name: str, pair: str, remedy: str
) -> None:
    verdict, failed, mends = outcome(name)
    assert verdict == "inconsistent"
    assert f"what does not fit: {pair}" in failed or f" {pair}" in failed
    assert remedy in mends
    assert bool(mends) == bool(remedy)
    with pytest.raises(CheckError) as caught:
        require_consistent(load_explosive(CASES / f"{name}.yaml"))
    assert remedy in str(caught.value)


def test_the_remedies_hold(tmp_path: Path) -> None:
    """The velocity, density and missing pressure that are offered make their files usable."""
    assert outcome("d2_hmx_noP")[0] == "usable, with warnings"
    for name, field, value in (
        ("c7_anfo_measured_vod", "detonation_velocity", "4159 m/s"),
        ("c7b_anfo_density_poured", "density", "930.5 kg/m3"),
        ("c6_hmx", "cj_pressure", None),
    ):
        content = yaml.safe_load((CASES / f"{name}.yaml").read_text())
        content = {k: v for k, v in (content | {field: value}).items() if v is not None}
        path = tmp_path / f"{name}.yaml"
        path.write_text(yaml.safe_dump(content))
        assert not rejected(load_explosive(path).check())


def test_the_command_line_says_all_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explosive", "check", str(CASES / "c6_hmx.yaml")]) == 4
    said = " ".join(capsys.readouterr().err.split())
    assert "what does not fit: jwl.E0 against cj_pressure" in said
    assert "would fit: the file without cj_pressure" in said


@pytest.mark.parametrize(
    ("written", "unit", "value"),
    [
        ("1.63 g/cc", "kg m-3", 1630.0),
        ("7 kJ/cc", "Pa", 7e9),
        ("0.07 Mbar", "Pa", 7e9),
        ("0.07 Mbar cc/cc", "Pa", 7e9),
        ("0.693 cm/us", "m s-1", 6930.0),
        ("7e10 erg/cc", "Pa", 7e9),
        ("1 ksi", "Pa", 6894757.293168361),
        ("100 lb/ft3", "kg m-3", 1601.846337396014),
        ("10 lbf/in2", "Pa", 68947.57293168361),
        ("3 yd", "m", 2.7432),
        ("2 gal", "m3", 7.570823568e-3),
        ("1 atm", "Pa", 101325.0),
    ],
)
def test_units_of_hydrocodes_and_of_the_united_states(
    written: str, unit: str, value: float
) -> None:
    """Factors: NIST Special Publication 811, appendix B."""
    assert convert(written, unit) == pytest.approx(value, rel=1e-9)
