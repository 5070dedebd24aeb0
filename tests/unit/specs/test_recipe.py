"""Recipes: read in SI units, all faults of a file at once, shipped ones as documented."""

from math import pi

import pytest
import yaml
from fake_blast import RECIPE, write_recipe

from castblast.design.variables import VARIABLES
from castblast.errors import SpecError
from castblast.specs.recipe import Recipe, load_recipe, recipe_from_text

PAPER_FEATURES = {
    "young_modulus", "ucs", "hole_diameter", "bench_height", "burden", "charge_length"
}  # fmt: skip
#: Training domain of the models: lower and upper bound as people write them.
DOMAIN = {
    "ucs": (10e6, 200e6),
    "young_modulus": (5e9, 50e9),
    "rock_density": (1800.0, 3000.0),
    "friction_angle": (25 * pi / 180, 55 * pi / 180),
    "dilation_angle": (0.0, 15 * pi / 180),
    "in_situ_stress": (0.0, 10e6),
    "hole_diameter": (0.08, 0.3),
    "burden": (1.0, 15.0),
    "bench_height": (5.0, 30.0),
    "face_angle": (60 * pi / 180, 90 * pi / 180),
}


def faults(tmp_path, **changes):
    with pytest.raises(SpecError) as caught:
        load_recipe(write_recipe(tmp_path / "r.yaml", **changes))
    return str(caught.value)


def test_quantities_are_read_in_si(tmp_path):
    recipe = load_recipe(write_recipe(tmp_path / "r.yaml")).recipe
    ucs = recipe.variables["ucs"]
    assert (ucs.lower, ucs.upper, ucs.distribution) == (10e6, 200e6, "log_uniform")
    assert recipe.variables["bench_height"].value == 10.0
    assert [spec.name for spec in recipe.sampled] == ["ucs", "burden", "charge_length"]


def test_quantiles_of_the_marginals(tmp_path):
    """Median of a log-uniform law is the geometric mean of its bounds; the ends are exact."""
    recipe = load_recipe(write_recipe(tmp_path / "r.yaml")).recipe
    ucs, burden = recipe.variables["ucs"], recipe.variables["burden"]
    assert ucs.at(0.5) == pytest.approx((10e6 * 200e6) ** 0.5, rel=1e-12)
    assert (ucs.at(0.0), ucs.at(1.0)) == (10e6, 200e6)
    assert burden.at(0.25) == pytest.approx(1.0 + 0.25 * 14.0)


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ({"uscs": {"lower": "1 MPa", "upper": "2 MPa"}}, "did you mean 'ucs'?"),
        ({"ucs": {"lower": "10 MPaa", "upper": "20 MPa"}}, "did you mean 'MPa'?"),
        ({"ucs": {"lower": "10 s", "upper": "20 MPa"}}, "'s' is a time; a pressure is needed"),
        ({"ucs": {"lower": 10, "upper": "20 MPa"}}, "no unit given"),
        ({"ucs": {"lower": "10 MPa", "uper": "20 MPa"}}, "did you mean 'upper'?"),
        ({"ucs": {"lower": "10 MPa", "upper": "20 GPa"}}, "allowed: 1 to 600 MPa"),
        ({"ucs": {"lower": "20 MPa", "upper": "10 MPa"}}, "lower (20 MPa) must be below upper"),
        ({"ucs": {"lower": "20 MPa"}}, "upper missing"),
        ({"ucs": {"lower": "1 MPa", "upper": "2 MPa", "value": "1 MPa"}}, "not both"),
        ({"ucs": {"lower": "1 MPa", "upper": "2 MPa", "distribution": "normal"}}, "'uniform'"),
        (
            {"dilation_angle": {"lower": "0 deg", "upper": "9 deg", "distribution": "log_uniform"}},
            "above zero",
        ),
        ({"zones": 100}, "goes under 'solver'"),
        (
            {"burden": "3 m", "spacing": {"lower": 1, "upper": 2, "ratio_of": "ucs"}},
            "another input of the same unit",
        ),
        ({"spacing": {"lower": 1, "upper": 2, "ratio_of": "burden"}}, "burden is not among"),
        (
            {"burden": "20 m", "spacing": {"lower": 1, "upper": 4, "ratio_of": "burden"}},
            "implausible: 20 m to 80 m; allowed: 0.2 m to 60 m",
        ),
        ({"ucs": "10 MPa"}, "none is sampled"),
    ],
)
def test_faults_of_a_variable(tmp_path, entry, expected):
    assert expected in faults(tmp_path, variables=entry)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"sed": 3}, "did you mean 'seed'?"),
        ({"seed": None}, "seed: is missing"),
        ({"version": "1.0"}, "three numbers are needed"),
        ({"name": "Small Set"}, "letters, digits, '-', '_' and '.' are allowed"),
        ({"explosives": []}, "explosives"),
        ({"explosives": ["anfo", "anfo"]}, "given twice: anfo"),
        ({"split": {"train": 0.9, "valid": 0.2, "calibration": 0, "test": 0}}, "add up to 1.1"),
        ({"solver": {"mode": "papr"}}, "'equilibrium' or 'paper'"),
        ({"solver": {"zones": 3}}, "at least 16 zones"),
        ({"burden_parameter_set": "mine"}, "'authors' or 'field'"),
        ({"constraints": {"minimum_stemming": 1}}, "did you mean 'minimum_stemming_ratio'?"),
        (
            {"constraints": {"minimum_stemming_ratio": 1, "maximum_stemming_ratio": 0.5}},
            "must be below",
        ),
        (
            {
                "variables": {
                    "ucs": RECIPE["variables"]["ucs"],
                    "bench_height": "9 m",
                    "charge_length": "5 m",
                    "stemming_length": "3 m",
                }
            },
            "it follows from the others",
        ),
    ],
)
def test_faults_of_a_recipe(tmp_path, changes, expected):
    message = faults(tmp_path, **changes)
    assert expected in message
    assert str(tmp_path / "r.yaml") in message


def test_every_fault_is_reported_at_once(tmp_path):
    message = faults(
        tmp_path,
        sed=1,
        size=0,
        variables={"ucs": {"lower": "1 Ma", "upper": "2 kg"}, "burdn": "3 m"},
    )
    for part in ("sed", "size", "variables.ucs.lower", "variables.ucs.upper", "burdn"):
        assert part in message
    assert len(message.splitlines()) == 5


def test_hash_is_of_the_content_not_of_its_spelling(tmp_path):
    one = load_recipe(write_recipe(tmp_path / "a.yaml")).recipe
    other = {**RECIPE["variables"], "bench_height": {"value": "1000 cm"}}
    two = load_recipe(write_recipe(tmp_path / "b.yaml", variables=other)).recipe
    three = load_recipe(write_recipe(tmp_path / "c.yaml", seed=8)).recipe
    assert one.sha256() == two.sha256() != three.sha256()


def test_size_override_is_in_the_kept_text(tmp_path):
    source = load_recipe(write_recipe(tmp_path / "r.yaml"), size=11)
    assert source.recipe.size == 11
    assert recipe_from_text(source.text, "file") == source.recipe


@pytest.mark.parametrize("name", ["quickstart", "paper", "full"])
def test_shipped_recipes_keep_to_the_domain(repository, name):
    recipe = load_recipe(repository / "data_specs" / "recipes" / f"{name}.yaml").recipe
    assert recipe.name == name
    assert recipe.size == (2000 if name == "quickstart" else 10_000)
    assert len(recipe.explosives) == 4
    assert recipe.solver.mode == "equilibrium"
    assert recipe.burden_parameter_set == "authors"
    for spec in recipe.sampled:
        if spec.name in DOMAIN:
            assert (spec.lower, spec.upper) == pytest.approx(DOMAIN[spec.name])
    log = {spec.name for spec in recipe.sampled if spec.distribution == "log_uniform"}
    assert log == {"ucs", "young_modulus"}


def test_paper_and_quickstart_differ_in_size_only(repository):
    folder = repository / "data_specs" / "recipes"
    paper, quickstart = (
        load_recipe(folder / f"{name}.yaml").recipe for name in ("paper", "quickstart")
    )
    assert {spec.name for spec in paper.sampled} == PAPER_FEATURES
    assert paper.variables == quickstart.variables
    held = {spec.name: spec.value for spec in paper.fixed if spec.ratio_of is None}
    for name, value in held.items():  # what is written down is what the physics would take anyway
        assert value == pytest.approx(VARIABLES[name].default)
    assert held["tensile_strength"] == 0.0


def test_full_recipe_varies_all_of_the_domain(repository):
    recipe = load_recipe(repository / "data_specs" / "recipes" / "full.yaml").recipe
    sampled = {spec.name for spec in recipe.sampled}
    extra = {"poisson_ratio", "tensile_strength", "spacing", "stemming_length"}
    assert sampled == set(DOMAIN) | extra


def test_recipe_is_frozen():
    recipe = Recipe.model_validate(yaml.safe_load(yaml.safe_dump(RECIPE)))
    with pytest.raises(ValueError, match="frozen"):
        recipe.size = 3
