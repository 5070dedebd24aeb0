"""The web page: one file, nothing from elsewhere, the numbers of the network, histories in bounds.

The histories are fitted to a made-up dataset whose pressures decay by a known law, so that the
record can be held against that law.
"""

import json
import re
from functools import partial
from html.parser import HTMLParser
from math import exp, log, pi

import numpy as np
import pytest
import xarray as xr
from page_scripts import ask, page_scripts
from toy_network import toy_network

from castblast.bands import BASIS, THROW_FACTOR, THROW_SD
from castblast.design.rule import complete_columns, design_faults, fault_columns, rules_as_data
from castblast.disk.resources import resource
from castblast.errors import SpecError
from castblast.export.web import PAGE, to_web
from castblast.muckpile.results.ballistic import block_throw
from castblast.network import Network, keeps_ranges_and_rules, predict_rows
from castblast.prediction.answer import load_network
from castblast.stages.export import export
from castblast.stages.web import build_page, shipped_page
from castblast.surrogate.history_modes import FORMAT, fit_history_modes

SPLITS = ("train", "valid", "calibration", "test")


class Tags(HTMLParser):
    """Every tag with its attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))


@pytest.fixture(scope="module")
def page() -> str:
    return to_web(toy_network())[PAGE].decode()


def test_nothing_is_fetched_from_elsewhere(page: str) -> None:
    """No tag names an address but data and places in the page, and the policy forbids the rest."""
    tags = Tags(page).found
    addresses = [a[key] for _, a in tags for key in ("src", "href", "action") if a.get(key)]
    assert all(address.startswith(("#", "data:")) for address in addresses)
    assert not re.search(r"@import|url\(|\bfetch\(|XMLHttpRequest|\bimport\(", page)
    policy = next(a["content"] for tag, a in tags if a.get("http-equiv"))
    assert policy.startswith("default-src 'none'")
    assert page.isascii()


def test_every_name_that_is_referred_to_is_there(page: str) -> None:
    """Ids are unique, and labels and headings point at one of them."""
    tags = Tags(page).found
    ids = [a["id"] for _, a in tags if "id" in a]
    assert len(ids) == len(set(ids))
    for _, attributes in tags:
        for key in ("for", "aria-labelledby", "aria-controls"):
            assert attributes.get(key) is None or attributes[key] in ids
    asked = set(re.findall(r'\bat\("([\w-]+)"\)', page)) | set(
        re.findall(r'(?<![.\w])place\("([\w-]+)"', page)
    )
    assert asked <= set(ids)


def test_the_page_shows_the_bands_of_python() -> None:
    """Values and prediction bands of tiles and batch; the throw is free flight times its factor."""
    network = toy_network()
    design = {"bench_height": 12.0, "charge_length": 5.0, "burden": 2.0}
    rows, batch = ask(
        page_scripts(network),
        f"""(() => {{
        const design = {{ explosive: "heavy_anfo", values: {json.dumps(design)} }};
        const {{ header, rows }} = answerBatch(batchTemplate(design));
        const of = Object.fromEntries(header.map((head, i) => [head, rows[1][i]]));
        return [resultsOf(design).rows, of];
        }})()""",
    )
    tiles = {row["key"]: row for row in rows}
    numeric = np.array([[design[name] for name in network.input_names]])
    truth = predict_rows(network, numeric, np.array([1]))
    for j, (name, unit) in enumerate((c.name, c.unit) for c in network.outputs):
        wanted = truth.values[0, j], *(end[0, j] for end in truth.prediction)
        assert [tiles[name][key] for key in ("value", "lower", "upper")] == pytest.approx(wanted)
        heads = f"{name} [{unit}]", *(
            f"{name}_prediction_{end} [{unit}]" for end in ("lower", "upper")
        )  # fmt: skip
        assert [batch[head] for head in heads] == pytest.approx(wanted)
    thrown, speed = tiles["throw_distance"], truth.values[0, 0]
    flight = block_throw(speed, 12.0)
    assert thrown["flight"] == pytest.approx(flight)
    assert thrown["value"] == pytest.approx(1.62 * flight)
    spread = log(thrown["upper"] / thrown["value"]) / 1.6448536
    own = network.outputs[0].relative_band / 1.959964
    assert spread**2 == pytest.approx(0.35**2 + 0.25**2 + own**2, rel=1e-6)
    heads = [f"throw_distance{end} [m]" for end in ("", "_prediction_lower", "_prediction_upper")]
    assert [batch[head] for head in heads] == [thrown[k] for k in ("value", "lower", "upper")]


def test_the_throw_holds_that_of_the_simulated_bench() -> None:
    """A bench 24 m high thrown at 12 m/s: 26.0 m simulated, and the page is surer than a factor 2.

    Throw of a slice 24 m wide of 800 balls, face of 70 degrees; free flight alone is 17.7 m.
    """
    thrown = THROW_FACTOR * block_throw(12.0, 24.0)
    own = exp(1.6448536 * THROW_SD)
    assert thrown / own < 26.0 < thrown * own
    assert own < 2.0


def test_the_page_says_what_its_bands_are(page: str) -> None:
    assert BASIS in page
    assert "not validated" in page
    assert "network band" in page


def toy_dataset() -> xr.Dataset:
    """Rise in proportion to time, then p = p0 s^-k with k = 0.5 + 0.1 ln(ucs / 50 MPa)."""
    rng = np.random.default_rng(3)
    n, points = 1200, 64
    ucs, diameter = np.exp(rng.uniform(log(2e7), log(2e8), n)), rng.uniform(0.1, 0.3, n)
    rise = diameter / 5000.0
    time = 60.0 * rise[:, None] * np.linspace(0.0, 1.0, points) ** 2
    s = time / rise[:, None]
    decay = (0.5 + 0.1 * np.log(ucs / 5e7))[:, None]
    pressure = 2e9 * np.where(s < 1.0, s, np.maximum(s, 1.0) ** -decay)
    area = 3e9 * pi / 4.0 * diameter**2
    names = {
        "plastic_work": 0.3, "elastic_energy": 0.05, "kinetic_energy": 0.02, "viscous_work": 0.05,
        "tensile_work": 0.0, "boundary_work": 0.0, "head_energy": 0.1, "ramp_energy": 0.08,
        "gas_energy": 0.4,
    }  # fmt: skip
    row = {name: ("sample", share * area) for name, share in names.items()}
    split = np.repeat(np.arange(4), [800, 100, 150, 150])
    flags = {"split": " ".join(SPLITS), "explosive": "anfo"}
    data = xr.Dataset(
        row
        | {
            "ucs": ("sample", ucs, {"role": "input"}),
            "hole_diameter": ("sample", diameter, {"role": "input"}),
            "charge_diameter": ("sample", diameter),
            "rise_time": ("sample", rise),
            "status": ("sample", np.zeros(n, dtype=np.int8)),
            "explosive": ("sample", np.zeros(n, dtype=np.int8)),
            "split": ("sample", split.astype(np.int8)),
            "history_time": (("sample", "history_point"), time),
            "history_pressure": (("sample", "history_point"), pressure),
            "explosive_total_energy": ("explosive_type", np.array([3e9])),
        }
    )
    for name, meanings in flags.items():
        data[name].attrs["flag_meanings"] = meanings
    data.attrs |= {"name": "toy", "dataset_version": "1", "content_sha256": "abc"}
    return data


@pytest.fixture(scope="module")
def histories() -> dict:
    return fit_history_modes(toy_dataset())


def test_histories_follow_the_law(histories: dict) -> None:
    """The decay of a design between the rows, to 1 percent, at every time of the record."""
    z = []
    for column in histories["inputs"]:
        x = {"ucs": 8e7, "hole_diameter": 0.2}[column["name"]]
        z.append(((log(x) if column["log"] else x) - column["mean"]) / column["scale"])
    terms = np.prod(np.array(z) ** np.array(histories["powers"]), axis=1)
    found = terms @ np.array(histories["coefficients"]["anfo"])
    modes = np.array(histories["modes"])
    curve = np.array(histories["mean"]) + found[: len(modes)] @ modes
    times = np.array(histories["times"])
    truth = log(2e9) - (0.5 + 0.1 * log(8e7 / 5e7)) * np.log(times)
    np.testing.assert_allclose(curve, truth, atol=0.01)
    assert found[len(modes) :].sum() == pytest.approx(1.0, abs=1e-6)


def test_histories_are_plain_numbers(histories: dict) -> None:
    assert histories["format"] == FORMAT
    assert json.loads(json.dumps(histories, allow_nan=False)) == histories
    assert histories["held_out"]["rows"] == 150


def test_histories_of_other_data_are_refused(histories: dict, tmp_path) -> None:
    network = toy_network()
    object.__setattr__(network, "provenance", {"dataset": {"content_sha256": "other"}})
    record = tmp_path / "histories.json"
    record.write_text(json.dumps(histories))
    with pytest.raises(SpecError, match="trained on other data"):
        build_page(network, tmp_path / "network.json")


def test_histories_are_for_the_page_only(tmp_path) -> None:
    network = resource("models/chosen/network.json")
    with pytest.raises(SpecError, match="for the target web, not for c, js"):
        export(network, tmp_path, targets=("c", "js"), histories=tmp_path / "histories.json")


def test_a_page_without_histories_says_so(page: str) -> None:
    assert '"histories":null' in page
    assert "did not come with this page" in page


def test_the_shipped_page_is_there(tmp_path) -> None:
    copy = shipped_page(tmp_path)
    assert copy.name == "index.html"
    assert copy.read_bytes() == shipped_page().read_bytes()


# the rule of a design


@pytest.fixture(scope="module", params=["full", "paper"])
def asked(request):
    """Network, and a function that evaluates an expression with the scripts of its page."""
    network = load_network(request.param)
    return network, partial(ask, page_scripts(network))


def as_charged(network, values: dict) -> dict:
    """The inputs of a network for a design, without a check."""
    full = {n: float(c[0]) for n, c in complete_columns(values, 1).items()}
    return {name: full[name] for name in network.input_names}


DESIGNS = (
    {},
    {"burden": 4.0, "spacing": 5.0, "bench_height": 15.0},
    {"stemming_length": 14.0},
    {"stemming_length": 11.9},
    {"burden": 0.25, "hole_diameter": 0.6},
    {"bench_height": 5.0, "burden": 6.0},
    {"dilation_angle": 0.9},
    {"burden": 40.0},
)


def test_the_page_refuses_and_completes_as_the_rule_does(asked) -> None:
    """14 m of stemming in a bench of 12.5 m: no answer, and not a charge of -1.5 m."""
    network, evaluated = asked
    rows = [as_charged(network, values) for values in DESIGNS]
    found = evaluated(
        f"{json.dumps(rows)}.map((values) => "
        "[refusals({ values }, 'metric'), completed({ values })])"
    )
    for row, (reasons, full) in zip(rows, found, strict=True):
        faults = fault_columns(row, 1)
        assert len(reasons) == sum(bool(fault.rows[0]) for fault in faults), row
        truth = {n: float(c[0]) for n, c in complete_columns(row, 1).items()}
        for name in ("spacing", "charge_diameter", "stemming_length", "charge_length"):
            assert full[name] == truth[name]
    assert found[0][0] == []
    assert any("no room" in reason or "plausible" in reason for reason in found[2][0])
    assert "plausible: 0.2" in " ".join(found[-1][0])


def test_the_page_carries_the_rule_as_data(page: str) -> None:
    """No number of the rule stands in a script: another rule in Python is another page."""
    assert json.dumps(rules_as_data(), separators=(",", ":")) in page
    scripts = page.split('"rule":')[1].split("/* Units:")[1]
    assert "0.7 *" not in scripts
    assert "?? full.burden" not in scripts


def test_refusals_are_said_in_words_and_in_the_units_of_the_reader(asked) -> None:
    network, evaluated = asked
    row = as_charged(network, {"stemming_length": 12.0})
    if "stemming_length" not in network.input_names:
        row["charge_length"] = 0.5
    metric, us = evaluated(
        f"['metric', 'us'].map((system) => refusals({{ values: {json.dumps(row)} }}, system)[0])"
    )
    metric, us = metric.replace("\u00a0", " "), us.replace("\u00a0", " ")
    assert metric.startswith(
        "Charge length 0.5000 m leaves no room for a column charge: at least 6"
    )
    assert "0.9000 m" in metric
    assert "1.640 ft" in us
    assert "_" not in metric + us


def table_head(network: Network) -> str:
    return ",".join(["explosive", *(f"{c.name} [{c.unit}]" for c in network.inputs)])


def test_a_table_of_designs_tells_impossible_ones_by_line(asked) -> None:
    network, evaluated = asked
    good = as_charged(network, {})
    bad = good | {"bench_height": 2.0}
    text = "\n".join(
        [
            table_head(network),
            *(",".join(["anfo", *(repr(v) for v in row.values())]) for row in (good, bad)),
        ]
    )
    found = evaluated(f"answerBatch({json.dumps(text)})")
    assert len(found["rows"]) == 1
    assert found["faults"]
    assert all(fault.startswith("line 3: ") for fault in found["faults"])


def test_spacing_and_stemming_go_with_the_burden(asked) -> None:
    """Ratios 1.2 and 0.8 at a burden of 3 m are kept at 4.5 m."""
    network, evaluated = asked
    row = as_charged(network, {"burden": 3.0, "spacing": 3.6, "stemming_length": 2.4})
    design = json.dumps({"explosive": "anfo", "values": row})
    moved = evaluated(f"completed({{ values: valuesAtBurden({design}, 4.5, ratiosOf({design})) }})")
    assert moved["burden"] == 4.5
    assert moved["stemming_length"] == pytest.approx(0.8 * 4.5)
    spacing = 1.2 * 4.5 if "spacing" in network.input_names else 4.5
    assert moved["spacing"] == pytest.approx(spacing)


def test_the_shaded_range_is_where_the_design_stays_valid(asked) -> None:
    """Each step of each slider against Python: possible, and not outside the domain."""
    network, evaluated = asked
    row = as_charged(network, {})
    design = {"explosive": "anfo", "values": row}
    for name in ("burden", "bench_height", "hole_diameter"):
        column = next(c for c in network.inputs if c.name == name)
        found = evaluated(
            f"validRange({json.dumps(design)}, network.inputs.find((c) => c.name === '{name}'), "
            f"ratiosOf({json.dumps(design)}))"
        )
        steps = np.geomspace(column.lower, column.upper, 41)
        steps[[0, -1]] = column.lower, column.upper
        expected = []
        for x in steps.tolist():
            moved = row | {name: x}
            if name == "burden":
                share = {"spacing": 1.0, "stemming_length": 0.7}
                moved |= {n: r * x for n, r in share.items() if n in row}
                if "charge_length" in row:
                    moved["charge_length"] = row["bench_height"] - 0.7 * x
            numeric = np.array([[moved[n] for n in network.input_names]])
            outside = not keeps_ranges_and_rules(network, numeric)[0]
            expected.append("impossible" if design_faults(moved) else outside)
        assert len(found["domains"]) == 41
        for kind, truth in zip(found["domains"], expected, strict=True):
            assert kind == truth if isinstance(truth, str) else (kind == "outside") == truth
        assert column.lower <= found["lower"] < found["upper"] <= column.upper
    for column in network.inputs:
        found = evaluated(
            f"validRange({json.dumps(design)}, network.inputs.find((c) => c.name === "
            f"'{column.name}'), ratiosOf({json.dumps(design)}))"
        )
        assert found["lower"] <= row[column.name] <= found["upper"], column.name
