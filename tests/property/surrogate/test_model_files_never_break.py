"""Whatever stands in a file of the surrogates: a result, or an error that says what is wrong."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from castblast.api.training.fits import kept_fits
from castblast.errors import CastblastError
from castblast.specs.models.model import make_model_spec, refuse_code
from castblast.surrogate.searching.study_file import hold_study

BOUNDED = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
KINDS = (
    "mlp", "levenberg", "torch_mlp", "gradient_boosting", "gaussian_process", "ridge", "custom",
)  # fmt: skip
FIELDS = (
    "name", "description", "features", "targets", "input_transform", "target_transform",
    "linear_features", "derived", "explosive_code", "search", "restarts", "seed", "hidden_layers",
    "activation", "penalty", "degree", "rows", "factory", "options", "training", "folder",
)  # fmt: skip
scalars = (
    st.none()
    | st.booleans()
    | st.integers(-(10**30), 10**30)
    | st.floats()
    | st.text(max_size=12)
    | st.sampled_from(
        ["ucs", "burden", "all", "log", "tanh", "os:system", "a.b:c", "burden_velocity"]
    )
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=6) | st.sampled_from(FIELDS), inner, max_size=3)
        | st.fixed_dictionaries({"coefficients": st.dictionaries(st.text(max_size=6), inner)})
    ),
    max_leaves=8,
)
contents = st.fixed_dictionaries(
    {"kind": st.sampled_from(KINDS) | values, "name": st.just("model") | values},
    optional=dict.fromkeys(FIELDS[1:], values),
)


def never_breaks(read: Callable[[], Any]) -> Any:
    """Give the result of a reader, or None where it says what is wrong."""
    try:
        return read()
    except CastblastError:
        return None


@BOUNDED
@given(content=contents | values)
def test_a_spec_of_a_model(content: Any) -> None:
    spec = never_breaks(lambda: make_model_spec(content, "model.yaml", Path()))
    if spec is not None:
        never_breaks(lambda: refuse_code([spec], allowed=False))
        assert len(spec.sha256()) == 64
        assert spec.quick().kind == spec.kind


@BOUNDED
@given(content=st.binary(max_size=40) | values.map(lambda v: json.dumps({"spec": v}).encode()))
def test_the_scores_in_a_folder_of_fits(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "fits" / "one").mkdir(parents=True, exist_ok=True)
    (tmp_path / "fits" / "dataset.txt").write_bytes(b"../data.nc\n")
    (tmp_path / "fits" / "one" / "fit.json").write_bytes(content)
    never_breaks(lambda: kept_fits(tmp_path / "fits"))


@BOUNDED
@given(note=st.binary(max_size=20))
def test_the_place_of_the_dataset_in_a_folder_of_fits(note: bytes, tmp_path: Path) -> None:
    spec = {"name": "one", "kind": "ridge"}
    (tmp_path / "fits" / "one").mkdir(parents=True, exist_ok=True)
    (tmp_path / "fits" / "dataset.txt").write_bytes(note)
    (tmp_path / "fits" / "one" / "fit.json").write_text(json.dumps({"spec": spec}))
    found = never_breaks(lambda: kept_fits(tmp_path / "fits"))
    assert found is None or not found[0].is_file()


@BOUNDED
@given(
    journal=st.binary(max_size=40)
    | st.lists(st.binary(max_size=20), max_size=3).map(
        lambda lines: b"".join(b'{"op_code":' + line + b"\n" for line in lines)
    )
)
def test_the_journal_of_a_study(journal: bytes, tmp_path: Path) -> None:
    (tmp_path / "study.journal").write_bytes(journal)

    def hold() -> None:
        with hold_study(tmp_path / "study.journal"):
            pass

    never_breaks(hold)


@pytest.mark.parametrize("depth", [10_000])
def test_deep_nesting_is_told(depth: int, tmp_path: Path) -> None:
    (tmp_path / "study.journal").write_bytes(b'{"op_code":' + b"[" * depth + b"\n")
    with (
        pytest.raises(CastblastError, match="not a study journal"),
        hold_study(tmp_path / "study.journal"),
    ):
        pass
