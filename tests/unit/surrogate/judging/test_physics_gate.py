"""A gate that knows the physics lets the truth pass and names the place of what is wrong."""

import json

import numpy as np
import pytest
from toy_physics import EXPLOSIVES, FEATURES, TARGETS, toy_domain, toy_predict

from castblast.design.variables import VARIABLES
from castblast.surrogate.judging.domain import dataset_domain
from castblast.surrogate.judging.gate import Surrogate, check_physics
from castblast.surrogate.judging.probe import physics_probe

VELOCITY = TARGETS.index("burden_velocity")


@pytest.fixture(scope="module")
def probe():
    return physics_probe(toy_domain(), points=64, dense=512)


def surrogate(change=None, features=FEATURES):
    """The toy physics itself, with its answers (n, 3) changed in place."""

    def predict(frame):
        answers = toy_predict(frame)
        if change is not None:
            change(frame, answers)
        return answers

    return Surrogate(predict, features, TARGETS)


def broken(document):
    return [check["name"] for check in document["checks"] if check["broken"]]


def test_points_are_possible_and_spread_over_the_domain() -> None:
    """Stemming and charge rules hold at every point; both ends of every input are reached."""
    domain = toy_domain()
    points = domain.spread(1024, seed=3)
    inputs = points.inputs
    stemming = inputs["bench_height"] - inputs["charge_length"]
    assert np.all(stemming >= 0.4 * inputs["burden"] * (1.0 - 1e-9))
    assert np.all(inputs["charge_length"] >= 6.0 * inputs["hole_diameter"] * (1.0 - 1e-9))
    np.testing.assert_array_equal(inputs["spacing"], inputs["burden"])
    assert points.shares.min(axis=0).max() < 0.03
    assert points.shares.max(axis=0).min() > 0.97
    again = domain.spread(1024, seed=3)
    np.testing.assert_array_equal(again.shares, points.shares)
    np.testing.assert_array_equal(again.explosive, points.explosive)


def test_a_move_keeps_the_rest_and_the_domain() -> None:
    """A tied spacing follows its burden; rows that would leave the domain stay as they are."""
    domain = toy_domain()
    points = domain.spread(256)
    moved, inside = domain.moved(points, {"burden": 1.2 * points.inputs["burden"]})
    assert 0 < inside.sum() < points.size
    changed = moved.inputs["burden"] / points.inputs["burden"]
    np.testing.assert_allclose(changed, np.where(inside, 1.2, 1.0), rtol=1e-12)
    np.testing.assert_array_equal(moved.inputs["spacing"], moved.inputs["burden"])
    for name in ("bench_height", "charge_length", "stemming_length", "ucs"):
        np.testing.assert_allclose(moved.inputs[name], points.inputs[name], rtol=1e-12)
    too_far = 1.2 * points.inputs["burden"] > 15.0
    assert not inside[too_far].any()


def test_slopes_of_the_simulator_are_found(probe) -> None:
    """Velocity ~ d^2 UCS^0.1 E^0.07 / (B S): in logarithms the slopes are the exponents."""
    slopes = {pairs.direction.name: pairs.slope for pairs in probe.pairs}
    exponents = {"ucs": 0.1, "young_modulus": 0.07, "hole_diameter": 2.0, "burden": -2.0}
    for name, exponent in exponents.items():
        np.testing.assert_allclose(slopes[name], exponent, rtol=1e-9)
    assert set(slopes) == {*exponents, "bench_height", "stemming_length"}
    document = probe.to_document()
    json.dumps(document, allow_nan=False)
    assert all(entry["simulator_breaks_sign"] == 0 for entry in document["directions"])


def test_the_truth_passes(probe) -> None:
    document = check_physics(surrogate(), probe)
    assert document["passed"], document["reasons"]
    assert sum(check["asked"] > 0 for check in document["checks"]) == 15
    json.dumps(document, allow_nan=False)


def test_a_wrong_sign_fails_and_its_place_is_named(probe) -> None:
    """Velocity that rises with burdens beyond 10 m is caught there and for nothing else."""

    def rise(frame, answers):
        answers[:, VELOCITY] *= np.maximum(frame["burden"].to_numpy() / 10.0, 1.0) ** 2.5

    document = check_physics(surrogate(rise), probe)
    assert not document["passed"]
    assert broken(document) == ["burden_velocity falls with burden"]
    assert document["reasons"] == [
        f"burden_velocity falls with burden: {check['broken']} of {check['asked']} answers are "
        "wrong"
        for check in document["checks"]
        if check["broken"]
    ]
    worst = next(check["worst"] for check in document["checks"] if check["broken"])
    assert worst["inputs"]["burden"] > 9.7
    assert worst["answers"]["slope"] == pytest.approx(0.5, abs=0.02)
    assert worst["explosive"] in EXPLOSIVES


def test_a_flat_answer_is_no_answer(probe) -> None:
    """A model that does not move at all with an input of its own fails where physics does."""

    def ignore(frame, answers):
        answers[:, VELOCITY] /= (frame["ucs"].to_numpy() / 1e8) ** 0.1

    assert broken(check_physics(surrogate(ignore), probe)) == ["burden_velocity rises with ucs"]


def test_slopes_that_are_hardly_there_are_forgiven_off_the_simulated_points(probe) -> None:
    """A slope wrong by less than a tenth of the typical one is within the error of any model."""

    def ripple(frame, answers):
        # slope of UCS 0.1 -> between 0.002 and 0.198
        answers[:, VELOCITY] *= np.exp(0.098 * np.sin(np.log(frame["ucs"].to_numpy())))

    assert check_physics(surrogate(ripple), probe)["passed"]


@pytest.mark.parametrize(
    ("target", "change", "rule"),
    [
        (0, lambda p: p + 3.2e9, "equilibrium below explosion pressure"),
        (0, lambda p: -p, "equilibrium_pressure is positive"),
        (0, lambda p: p * np.where(p > 3e8, np.nan, 1.0), "equilibrium_pressure is positive"),
        (0, lambda p: np.where(p > 3e8, 100.0 * p, p), "equilibrium_pressure does not blow up"),
        (2, lambda r: 0.4 * r, "the hole does not shrink"),
        (1, lambda v: 200.0 * v, "kinetic energy below the charge's"),
    ],
)
def test_answers_against_nature_fail(probe, target, change, rule) -> None:
    def spoil(_, answers):
        answers[:, target] = change(answers[:, target])

    document = check_physics(surrogate(spoil), probe)
    assert rule in broken(document)
    json.dumps(document, allow_nan=False)


@pytest.mark.parametrize(("share", "allowed"), [(0.98, True), (1.02, False)])
def test_the_burden_before_an_inclined_face_includes_its_toe(share, allowed) -> None:
    """Rock thrown with a little more than the heat of its charge is refused, a little less is not.

    The section of the burden is a trapezium, B wide at the crest and B + H cot(face angle) at the
    toe: without the toe its mass, and so its energy, would be several times too small.
    """
    domain = toy_domain(face_angle={"lower": "60 deg", "upper": "75 deg"})
    names = (*FEATURES, "spacing", "face_angle")
    energy = dict(zip(EXPLOSIVES, domain.energy.tolist(), strict=True))

    def at_the_bound(frame):
        answers = toy_predict(frame)
        x = {name: frame[name].to_numpy() for name in names}
        width = x["burden"] + x["bench_height"] / np.tan(x["face_angle"])
        section = 0.5 * (x["burden"] + width) * x["bench_height"]
        mass = VARIABLES["rock_density"].default * section * x["spacing"]
        heat = np.array([energy[name] for name in frame["explosive"]])
        heat *= 0.25 * np.pi * x["hole_diameter"] ** 2 * x["charge_length"]
        answers[:, VELOCITY] = np.sqrt(2.0 * share * heat / mass)
        return answers

    document = check_physics(
        Surrogate(at_the_bound, names, TARGETS), physics_probe(domain, points=64, dense=256)
    )
    name = "kinetic energy below the charge's"
    check = next(check for check in document["checks"] if check["name"] == name)
    assert check["asked"] == 256
    assert check["broken"] == (0 if allowed else 256)


def test_what_the_simulator_breaks_is_not_asked() -> None:
    """With a simulator whose velocity rises with the burden, no model is blamed for either."""

    def twist(inputs, outputs):
        return {"burden_velocity": outputs["burden_velocity"] * inputs["burden"] ** 3}

    document = check_physics(surrogate(), physics_probe(toy_domain(twist), points=64, dense=256))
    check = next(c for c in document["checks"] if c["name"] == "burden_velocity falls with burden")
    assert check["not_asked"] == "the simulator itself breaks it"
    assert check["broken"] == 0


def test_what_a_model_does_not_take_is_not_asked(probe) -> None:
    def predict(frame):
        return toy_predict(frame.assign(young_modulus=2e10))

    features = tuple(name for name in FEATURES if name != "young_modulus")
    document = check_physics(Surrogate(predict, features, TARGETS), probe)
    assert document["passed"], document["reasons"]
    not_asked = {c["name"]: c["not_asked"] for c in document["checks"] if "not_asked" in c}
    assert not_asked == {
        "burden_velocity rises with young_modulus": "young_modulus is no input of this model"
    }


def test_a_higher_bench_is_faster_or_slower_as_the_powder_factor_says() -> None:
    """Before an inclined face toe burden may outgrow the charge; the toy follows exactly."""
    domain = toy_domain(
        charge_length=None,
        stemming_length={"lower": 0.4, "upper": 1, "ratio_of": "burden"},
        face_angle={"lower": "60 deg", "upper": "90 deg"},
    )
    probe = physics_probe(domain, points=256, dense=256)
    pairs = next(p for p in probe.pairs if p.direction.name == "bench_height")
    assert {-1.0, 0.0, 1.0} == set(pairs.sign)
    assert np.all((pairs.sign * pairs.slope)[pairs.sign != 0.0] > 0.0)
    assert pairs.kept


def test_a_dataset_that_carries_no_recipe_has_no_domain(toy_dataset) -> None:
    from castblast.errors import DatasetError

    with pytest.raises(DatasetError, match="carries no recipe and no explosive_specs"):
        dataset_domain(toy_dataset(50))
