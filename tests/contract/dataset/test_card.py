"""The card of a dataset: headings of a datasheet, statistics of the training rows only."""

import numpy as np
import pytest
from fake_blast import fake_generate, fake_simulator, write_recipe

from castblast.dataset.file.card import make_card, training_statistics
from castblast.dataset.file.schema import flag_names
from castblast.dataset.file.store import open_dataset


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("card")
    recipe = write_recipe(folder / "r.yaml", max_failed_share=1.0)
    simulator = fake_simulator(recipe, fail_above=100e6)
    return fake_generate(recipe, folder / "data.nc", simulator=simulator).path


def test_card_stands_beside_the_file(path):
    text = path.with_name("DATASHEET.md").read_text(encoding="utf-8")
    assert text == make_card(open_dataset(path))
    for heading in ("Motivation", "Composition", "Collection", "Uses", "Limits", "Distribution"):
        assert f"## {heading}" in text
    assert "| ucs: uniaxial compressive strength | MPa | 10 to 200, log-uniform |" in text
    assert "not_converged" in text
    assert "anfo 20, doped_emulsion 20, heavy_anfo 20" in text


def test_statistics_are_those_of_the_finished_training_rows(path):
    dataset = open_dataset(path)
    rows = (flag_names(dataset["split"]) == "train") & (dataset["status"].to_numpy() == 0)
    values = dataset["burden_velocity"].to_numpy()[rows]
    found = training_statistics(dataset, "burden_velocity")
    assert found["mean"] == pytest.approx(values.mean())
    assert found["std"] == pytest.approx(values.std())
    assert (found["min"], found["max"]) == (values.min(), values.max())


def test_rows_kept_for_tests_do_not_show(path):
    dataset = open_dataset(path)
    before = make_card(dataset)
    other = flag_names(dataset["split"]) != "train"
    dataset["burden_velocity"].to_numpy()[other] = 499.0
    assert make_card(dataset) == before
    assert np.isfinite(training_statistics(dataset, "ucs")["mean"])
