"""Damaged files of holes, balls, ore and designs: a result or a fault that names the file."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from castblast.errors import CastblastError
from castblast.muckpile.bench.geometry import Bench
from castblast.prediction.answer import load_network
from castblast.specs.bench.balls.files import read_balls
from castblast.specs.bench.holes import read_holes
from castblast.specs.bench.ore import read_ore
from castblast.stages.predict_table import predict_csv

DATA = Path(__file__).parents[2] / "unit" / "data"
BENCH = Bench(18.0, 9.0, 10.0, burden=3.0, spacing=3.6)
NETWORK = load_network()
ORE = b"name,x [m],y [m],grade\nA,-6,0,2\nA,-3,0,2\nA,-3,12,2\nB,-9,0,1\nB,-7,0,1\nB,-7,9,1\n"
#: Pieces that mean something to some reader, besides any bytes.
PIECES = [
    b"", b",", b";", b'"', b"\n", b"\t", b"#", b"[", b"(", b"\0", b"\xff\xfe", b"\xb0", b"nan",
    b"-", b"1e999", b"1,5", b"ITEM: ATOMS id x y z\n", b"9999999999999999999999", b" m", b"=1+1",
    b"1e300", b"ITEM:", b"Atoms\n\n", b"\xe2\x80\xa8",
]  # fmt: skip


def holes(path: Path) -> object:
    return read_holes(path, BENCH, by_block=False)


def designs(path: Path) -> object:
    return predict_csv(path).text


READERS = [
    *((holes, path) for path in sorted((DATA / "holes").iterdir()) if path.suffix != ".yaml"),
    *((read_balls, path) for path in sorted((DATA / "balls").iterdir())),
    *((designs, path) for path in sorted((DATA / "designs").iterdir())),
    (lambda path: read_ore(path, BENCH), Path("ore.csv")),
]


@pytest.mark.parametrize(("reader", "path"), READERS, ids=[path.name for _, path in READERS])
@given(seed=st.integers(0, 2**32))
@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_damaged_files(reader, path: Path, tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    data = bytearray(ORE if path.name == "ore.csv" else path.read_bytes())
    for _ in range(rng.randint(1, 6)):
        # The beginning decides what a file is taken for.
        most = len(data) if rng.random() < 0.5 else min(len(data), 200)
        at = rng.randint(0, most)
        piece = rng.choice(PIECES) if rng.random() < 0.7 else rng.randbytes(rng.randint(1, 4))
        data[at : at + rng.choice((0, 0, 1, 5, 40))] = piece
    if rng.random() < 0.2:
        del data[rng.randint(0, len(data)) :]
    damaged = tmp_path / path.name
    damaged.write_bytes(bytes(data))
    named = True
    try:
        assert reader(damaged) is not None
    except CastblastError as fault:
        named = str(damaged) in str(fault)
    assert named
