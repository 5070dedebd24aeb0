"""The surrogate beside the physics it was trained on, for one design and along the burden."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from castblast.bands import BASIS, prediction_factor, show_band, show_value
from castblast.blast.run import make_case, result_values, run_blast
from castblast.disk.files import write_json
from castblast.network import evaluate
from castblast.progress import ProgressCallback
from castblast.report.prediction_figures import VelocityCurve, draw_velocity_curves
from castblast.specs.explosive import load_explosive
from castblast.prediction.answer import complete_inputs, load_network, predict
from castblast.stages.simulate import simulate

EXPLOSIVE = "anfo"
HOLE_DIAMETERS = (0.102, 0.165, 0.25)
BURDENS = np.array([2.0, 3.0, 4.5, 6.5, 9.0])


def compare_with_physics(network: Path, out: Path, progress: ProgressCallback) -> list[str]:
    """Predict and simulate the default design, and burden velocity over burden.

    Writes ``comparison.json``, ``velocity.png`` and the pictures of the simulation into `out`.
    """
    predicted = predict({}, EXPLOSIVE, network)
    progress(0.0, "simulating the default design")
    simulated = simulate(explosive=EXPLOSIVE, values={}, out=out).document
    names = list(predicted["network_band"])
    document = {
        "explosive": EXPLOSIVE,
        "inputs": predicted["inputs"],
        "predicted": {name: predicted[name] for name in names},
        "prediction_band": predicted["prediction_band"],
        "prediction_basis": predicted["prediction_basis"],
        "network_band": predicted["network_band"],
        "simulated": {name: simulated[name] for name in names},
    }
    curves = []
    for number, diameter in enumerate(HOLE_DIAMETERS):
        progress((number + 1) / (len(HOLE_DIAMETERS) + 1), f"hole diameter {diameter * 1e3:g} mm")
        curves.append(_velocity_curve(network, diameter))
    draw_velocity_curves(
        out / "velocity.png",
        "Surrogate (lines) and physics (dots), ANFO, other inputs at defaults",
        curves,
    )
    write_json(out / "comparison.json", document)
    speed = {"predicted": predicted["burden_velocity"], "simulated": simulated["burden_velocity"]}
    ratio = speed["predicted"] / speed["simulated"] - 1.0
    shown = [f"{show_value('burden_velocity', v)} m/s {word}" for word, v in speed.items()]
    band = show_band("burden_velocity", speed["simulated"])
    return [f"burden velocity {', '.join(shown)} ({ratio:+.2%}); {band} m/s, {BASIS}"]


def _velocity_curve(path: Path, diameter: float) -> VelocityCurve:
    network = load_network(path)
    burden = np.linspace(BURDENS[0], BURDENS[-1], 60)
    designs = [complete_inputs({"burden": b, "hole_diameter": diameter}, network) for b in burden]
    columns = {name: np.array([design[name] for design in designs]) for name in designs[0]}
    velocity = evaluate(network, columns, EXPLOSIVE)["burden_velocity"]
    band = next(c.relative_band for c in network.outputs if c.name == "burden_velocity")
    factor = prediction_factor("burden_velocity", band)
    explosive = load_explosive(EXPLOSIVE).to_explosive()
    simulated = [
        result_values(run_blast(make_case(explosive, {"burden": b, "hole_diameter": diameter})))
        for b in BURDENS.tolist()
    ]
    return VelocityCurve(
        label=f"{diameter * 1e3:.0f} mm hole",
        burden=burden,
        velocity=velocity,
        lower=velocity / factor,
        upper=velocity * factor,
        simulated_burden=BURDENS,
        simulated_velocity=np.array([values["burden_velocity"] for values in simulated]),
    )
