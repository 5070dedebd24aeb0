"""Which way the simulated burden velocity moves with each input, over the shipped recipes.

Required of the physics (more rock or room for the gas: slower; more or better confined gas:
faster) and, once verified here, of every surrogate by the physics gate. A bench that is higher at
the same stemming is faster before an upright face; before an inclined one the toe burden grows as
well, and velocity goes with the powder factor.
"""

import numpy as np
import pytest

from castblast.dataset.file.provenance import load_explosives
from castblast.dataset.rows.simulation import blast_simulator
from castblast.specs.recipe import load_recipe
from castblast.surrogate.judging.domain import Domain
from castblast.surrogate.judging.probe import DIRECTIONS, physics_probe


def probe(repository, name, points):
    source = load_recipe(repository / "data_specs" / "recipes" / f"{name}.yaml")
    entries = load_explosives(source)
    explosives = tuple(entry.spec.to_explosive() for entry in entries)
    energy = np.array([entry.density * entry.heat_of_explosion for entry in explosives])
    simulator = blast_simulator(source.recipe, explosives)
    names = tuple(entry.name for entry in entries)
    return physics_probe(Domain(source.recipe, simulator, names, energy), points, dense=16)


@pytest.mark.parametrize(
    ("recipe", "points", "missing"),
    [
        ("paper", 40, {"friction_angle", "rock_density", "spacing", "face_angle"}),
        ("full", 56, set()),
    ],
)
def test_required_signs_hold_everywhere(repository, recipe, points, missing) -> None:
    """No pair of points breaks a sign, by however little, but for stemming that is blown out.

    Stemming of a few hole diameters leaves the hole while the burden still accelerates; a longer
    one then keeps the gas in about as much as it shortens the charge, and the slope is nearly 0.
    The friction angle has no sign.
    """
    found = {p.direction.name: p for p in probe(repository, recipe, points).pairs}
    assert set(found) == {direction.name for direction in DIRECTIONS} - missing
    for name, pairs in found.items():
        required = pairs.sign != 0.0
        least = np.zeros(len(pairs.slope))
        if name == "stemming_length":
            inputs = pairs.at.inputs
            least[inputs["stemming_length"] < 6.0 * inputs["hole_diameter"]] = -0.005
        assert np.all((pairs.sign * pairs.slope > least)[required]), name
        if name != "bench_height":
            assert required.all() == (name != "friction_angle")
    if recipe == "full":
        assert {-1.0, 0.0, 1.0} == set(found["bench_height"].sign)
        assert found["friction_angle"].slope.min() < 0.0 < found["friction_angle"].slope.max()
