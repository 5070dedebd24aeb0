"""`castblast simulate` as a user meets it: keys, units, files, end modes, own explosives."""

import json
import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

Run = Callable[..., "subprocess.CompletedProcess[str]"]

LEDGER = (
    "kinetic_energy", "elastic_energy", "plastic_work", "tensile_work", "viscous_work",
    "boundary_work",
)  # fmt: skip


def simulate(castblast: Run, *arguments: object) -> dict[str, object]:
    done = castblast("simulate", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    document: dict[str, object] = json.loads(done.stdout)
    return document


def test_document(castblast: Run, tmp_path: Path) -> None:
    """All promised keys, in SI, and a ledger that closes with the printed numbers alone."""
    out = simulate(castblast, "--explosive", "anfo", "--out", tmp_path)
    promised = {
        "equilibrium_pressure", "expanded_hole_radius", "crushed_zone_radius",
        "plastic_zone_radius", "burden_velocity", "gas_work", "energy_residual",
    }  # fmt: skip
    for key in promised:
        assert math.isfinite(out[key])
    assert out["settled"] is True
    assert out["status"] == "ok"
    assert sum(out[key] for key in LEDGER) == pytest.approx(out["gas_work"], rel=1e-3)
    assert 1e8 < out["equilibrium_pressure"] < 5e8
    assert {path.name for path in tmp_path.iterdir()} == {
        "result.json", "near_field_history.csv", "burden_history.csv", "simulation.png",
    }  # fmt: skip
    history = np.genfromtxt(tmp_path / "near_field_history.csv", delimiter=",", skip_header=1)
    assert history.shape == (64, 3)


def test_paper_mode_ends_before_the_wave_arrives(castblast: Run) -> None:
    """0.9 (R - a) / c_p with c_p from the elastic moduli of the defaults: 1.61 ms."""
    out = simulate(castblast, "--mode", "paper")
    wave_speed = math.sqrt(2e10 * 0.75 / (1.25 * 0.5) / 2600.0)
    assert out["end_time"] == pytest.approx(0.9 * (5.5 - 0.075) / wave_speed, rel=1e-3)


def test_case_file_and_options_agree(castblast: Run, tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_text("explosive: heavy_anfo\nparameter_set: field\nset:\n  ucs: 60 MPa\n")
    by_file = simulate(castblast, path)
    by_option = simulate(castblast, "--explosive", "heavy_anfo", "--parameter-set", "field",
                         "--set", "ucs=60 MPa")  # fmt: skip
    assert by_file == by_option


def test_inconsistent_explosive_runs_only_on_request(castblast: Run, tmp_path: Path) -> None:
    """The emulsion of the independent near-field study fails the CJ relations, yet can be run."""
    path = tmp_path / "emulsion.yaml"
    path.write_text(
        "name: emulsion\ndensity: 1180 kg/m3\ndetonation_velocity: 5122 m/s\n"
        "heat_of_explosion: 3.3 MJ/kg\nsource: rock-blasting literature\n"
        "jwl: {A: 276.2 GPa, B: 8.44 GPa, C: 1.36039 GPa, R1: 5.2, R2: 2.1, omega: 0.5,\n"
        "      E0: 3.87 GPa}\n"
    )
    refused = castblast("simulate", "--explosive", path)
    assert refused.returncode == 4
    assert "--allow-inconsistent" in refused.stderr
    out = simulate(castblast, "--explosive", path, "--allow-inconsistent")
    assert out["equilibrium_pressure"] > 1e8
