"""A domain whose physics is a closed form: velocity follows powder factor, strength and stiffness.

Everything a surrogate is judged by can then be known: slopes, limits and energies.
"""

from dataclasses import dataclass

import numpy as np

from castblast.dataset.rows.simulation import BatchResult, BlastSimulator, blast_simulator
from castblast.design.variables import OUTPUT_NAMES
from castblast.specs.explosive import load_explosive
from castblast.specs.loading import make_spec
from castblast.specs.recipe import Recipe
from castblast.surrogate.judging.domain import Domain

EXPLOSIVES = ("anfo", "doped_emulsion")
FEATURES = ("ucs", "young_modulus", "hole_diameter", "bench_height", "burden", "charge_length")
TARGETS = ("equilibrium_pressure", "burden_velocity", "expanded_hole_radius")
VARIABLES = {
    "ucs": {"lower": "10 MPa", "upper": "200 MPa", "distribution": "log_uniform"},
    "young_modulus": {"lower": "5 GPa", "upper": "50 GPa", "distribution": "log_uniform"},
    "hole_diameter": {"lower": "80 mm", "upper": "300 mm"},
    "bench_height": {"lower": "5 m", "upper": "30 m"},
    "burden": {"lower": "1 m", "upper": "15 m"},
    "charge_length": {"lower": 0.2, "upper": 0.95, "ratio_of": "bench_height"},
    "spacing": {"value": 1, "ratio_of": "burden"},
}


def toy_outputs(inputs, explosive):
    """Targets by name; `explosive` are indices into EXPLOSIVES."""
    ucs, young = inputs["ucs"] / 1e8, inputs["young_modulus"] / 2e10
    height = inputs["bench_height"]
    toe = 0.5 * height / np.tan(inputs.get("face_angle", np.full(len(ucs), 0.5 * np.pi)))
    spacing = inputs.get("spacing", inputs["burden"])
    volume = spacing * (inputs["burden"] + toe) * height
    density = inputs.get("rock_density", 2600.0)
    factor = 750.0 * inputs["hole_diameter"] ** 2 * inputs["charge_length"] / (volume * density)
    strength = np.array([1.0, 1.1])[explosive]
    return {
        "equilibrium_pressure": 2.5e8 * ucs**0.5 * young**0.1 * strength,
        "burden_velocity": 6e3 * strength * factor * ucs**0.1 * young**0.07,
        "expanded_hole_radius": inputs["hole_diameter"] * (0.6 + 0.2 / (0.2 + ucs)),
    }


@dataclass(frozen=True)
class ToyBlast(BlastSimulator):
    """The closed form in place of the simulation; `twist` changes its outputs."""

    twist: object = None

    def run(self, inputs, explosive):
        count = len(explosive)
        outputs = dict.fromkeys(OUTPUT_NAMES, np.full(count, 0.5))
        outputs |= {"explosion_pressure": np.array([3e9, 5e9])[explosive]}
        outputs |= toy_outputs(inputs, explosive)
        if self.twist is not None:
            outputs |= self.twist(inputs, outputs)
        return BatchResult(np.zeros(count, dtype=np.int8), outputs, {})


def toy_domain(twist=None, **variables) -> Domain:
    """Domain of the paper's features with the toy physics on it."""
    recipe = make_spec(
        {
            "name": "toy", "version": "1.0.0", "title": "toy", "size": 100, "seed": 1,
            "explosives": list(EXPLOSIVES),
            "variables": {k: v for k, v in {**VARIABLES, **variables}.items() if v is not None},
        },
        Recipe,
        "toy",
    )  # fmt: skip
    explosives = tuple(load_explosive(name).to_explosive() for name in EXPLOSIVES)
    real = blast_simulator(recipe, explosives)
    energy = np.array([entry.density * entry.heat_of_explosion for entry in explosives])
    toy = ToyBlast(real.explosives, real.settings, real.solver_inputs, twist)
    return Domain(recipe, toy, EXPLOSIVES, energy)


def toy_predict(frame):
    """A perfect surrogate: targets (n, 3) of a frame of features."""
    inputs = {name: frame[name].to_numpy() for name in frame.columns if name != "explosive"}
    index = np.array([EXPLOSIVES.index(name) for name in frame["explosive"]])
    outputs = toy_outputs(inputs, index)
    return np.stack([outputs[name] for name in TARGETS], axis=1)
