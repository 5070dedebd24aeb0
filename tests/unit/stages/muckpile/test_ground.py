"""Ground of a bench file in a run, decks instead of a run, and runs that are taken up again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from small_bench import write_bench

from castblast.api.muckpile.document import bench_content
from castblast.errors import SpecError
from castblast.muckpile.cast.case import CastCase, CastResult
from castblast.muckpile.ground.terrain import heightmap
from castblast.muckpile.ground.walls import ground_height
from castblast.specs.bench.bench import load_bench
from castblast.stages.muckpile import run as muckpile
from castblast.stages.muckpile.deck import Decks
from castblast.stages.muckpile.run import run_muckpile

X, Y = np.arange(0.0, 9.0), np.arange(-6.0, 11.0)


@pytest.fixture(scope="module")
def packings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("packings")


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> list[tuple[CastCase, CastResult]]:
    """Case and result of each run; files and pictures are left out."""
    seen: list[tuple[CastCase, CastResult]] = []

    def keep(folder: Path, spec: object, case: CastCase, result: CastResult, *rest: object) -> list:
        seen.append((case, result))
        return []

    monkeypatch.setattr(muckpile, "write_results", keep)
    return seen


def written(folder: Path, height: np.ndarray | None = None, **change: Any) -> Path:
    """Bench file; with heights also their file, which begins 3 m before the face."""
    if height is not None:
        np.savez(folder / "pile.npz", x=X, y=Y, height=height)
        change |= {"ground": {"heightmap": "pile.npz", "shift": ["3 m", "0 m", "0 m"]}}
    return write_bench(folder, **change)


def test_rock_comes_to_rest_on_the_ground(
    tmp_path: Path, packings: Path, ends: list[tuple[CastCase, CastResult]]
) -> None:
    """A bank that rises 1 in 2: all balls end above it, many on it, and nearer than on a floor."""
    bank = np.tile(0.5 * X, (len(Y), 1))
    options = {"threads": 1, "packings": packings}
    far = run_muckpile(written(tmp_path), tmp_path / "out", **options).document
    near = run_muckpile(written(tmp_path, bank), tmp_path / "out", **options).document
    assert near["packing_reused"]
    assert near["runout_99"] < far["runout_99"]
    case, result = ends[-1]
    x, y, z = result.particles.position.T
    radius = result.particles.radius
    ground = ground_height(case.walls, x, y)
    on_bank = ground > 0.0
    assert on_bank.sum() > 10
    # The nearest point of a 1 in 2 slope is R / cos below a centre that rests on it.
    rise = np.hypot(1.0, 0.5) * radius[on_bank]
    assert (z[on_bank] - ground[on_bank] > 0.9 * rise).all()
    assert (z[~on_bank] > 0.9 * radius[~on_bank]).all()


def test_ground_that_cuts_the_packing_is_refused(tmp_path: Path, packings: Path) -> None:
    """The bank reaches 1 m into the bench; the packing is kept."""
    bank = np.tile(0.5 + 0.5 * X, (len(Y), 1))
    bench = written(tmp_path, bank)
    content = yaml.safe_load(bench.read_text())
    content["ground"]["shift"][0] = "-1 m"
    bench.write_text(yaml.safe_dump(content))
    with pytest.raises(SpecError) as caught:
        run_muckpile(bench, tmp_path / "out", threads=1, packings=packings)
    lines = str(caught.value).splitlines()
    assert all(line.startswith("small: ") for line in lines)
    assert any("of the packing" in line for line in lines)
    assert not (tmp_path / "out").exists()


def test_ground_with_pits_narrower_than_balls_is_refused(tmp_path: Path, packings: Path) -> None:
    """Heights that alternate by 1 m; averaged over 2 m they are level ground."""
    rough = np.add.outer(np.arange(len(Y)), np.arange(len(X))) % 2 * 1.0
    options = {"threads": 1, "packings": packings, "decks": Decks(None, tmp_path / "deck")}
    with pytest.raises(SpecError, match="heights stand out from both neighbours"):
        run_muckpile(written(tmp_path, rough), tmp_path / "out", **options)
    bench = written(tmp_path, rough)
    content = yaml.safe_load(bench.read_text())
    content["ground"]["smooth"] = "2 m"
    bench.write_text(yaml.safe_dump(content))
    assert run_muckpile(bench, tmp_path / "out", **options).files


def test_a_surface_that_faces_down_is_turned_and_said(
    tmp_path: Path, packings: Path, ends: list[tuple[CastCase, CastResult]]
) -> None:
    """One facet doubled, all turned: bit for bit the cast onto the sound surface, and its energy.

    Balls on the back of a surface were pushed through it, at 22 times the energy of the blast.
    """
    trimesh = pytest.importorskip("trimesh")
    bank = heightmap(X + 3.0, Y, np.tile(0.5 * X, (len(Y), 1))).corner
    down = np.concatenate([bank, bank[[7]]])[:, ::-1]
    documents = []
    for name, corner in (("sound.stl", bank), ("down.stl", down)):
        mesh = trimesh.Trimesh(corner.reshape(-1, 3), np.arange(3 * len(corner)).reshape(-1, 3))
        mesh.export(tmp_path / name, file_type="stl_ascii")
        out = tmp_path / name.removesuffix(".stl")
        run = run_muckpile(
            written(tmp_path, ground=name), out, threads=1, packings=packings, velocity="6 m/s"
        )
        documents.append(run.document)
        assert run.remarks[: len(run.document.get("ground_remarks", []))] == run.document.get(
            "ground_remarks", []
        )
    sound, turned = documents
    assert "ground_remarks" not in sound
    assert turned["ground_remarks"] == [
        f"{tmp_path / 'down.stl'}: 1 facet lay on another with the same corners (facet "
        f"{len(bank)}): dropped",
        f"{tmp_path / 'down.stl'}: {len(bank)} facets faced away from the balls (facet 0, 1, 2 "
        f"and {len(bank) - 3} more): turned",
    ]
    one, two = (result.particles for _, result in ends)
    np.testing.assert_array_equal(one.position, two.position)
    assert abs(turned["ledger"]["residual"]) < 0.01


def test_balls_in_the_grid_of_the_mine_are_refused(tmp_path: Path) -> None:
    (tmp_path / "balls.csv").write_text(
        "x,y,z,radius\n45231,73892,598,0.5\n45232.5,73892,598,0.5\n"
    )
    with pytest.raises(SpecError, match=r"km from the bench .* move all balls by \[-45234 m, "):
        run_muckpile(written(tmp_path, balls="balls.csv"), tmp_path / "out", threads=1)


def test_hash_of_a_bench_covers_the_files_that_it_names(tmp_path: Path) -> None:
    """Not its layout; a changed height, ball or hole is another bench under the same name."""
    height = np.zeros((len(Y), len(X)))
    bench = written(tmp_path, height, firing={"holes": "holes.csv"}, balls="balls.csv")
    (tmp_path / "holes.csv").write_text("x [m],y [m],delay [ms]\n-1,1,0\n")
    (tmp_path / "balls.csv").write_text("x,y,z,radius\n-1,1,0.5,0.5\n")

    def content() -> dict[str, Any]:
        return bench_content(load_bench(bench), tmp_path)

    first = content()
    assert set(first["bench_files"]) == {"pile.npz", "holes.csv", "balls.csv"}
    bench.write_text("# a remark\n" + bench.read_text())
    assert content() == first
    seen = {first["bench_sha256"]}
    for name in ("holes.csv", "balls.csv"):
        (tmp_path / name).write_text((tmp_path / name).read_text() + "-3,3,0.5,0.5\n")
        seen.add(content()["bench_sha256"])
    np.savez(tmp_path / "pile.npz", x=X, y=Y, height=height + 0.1)
    seen.add(content()["bench_sha256"])
    assert len(seen) == 4


def test_decks_instead_of_a_run(tmp_path: Path, packings: Path) -> None:
    """The balls of the packing, as the run would get them; LAMMPS refuses facets in one line."""
    decks = Decks(tmp_path / "lammps", tmp_path / "liggghts")
    options = {"threads": 1, "packings": packings}
    outcome = run_muckpile(written(tmp_path), tmp_path / "out", decks=decks, **options)
    assert outcome.document["balls"] == pytest.approx(150, abs=10)
    assert [path.name for path in outcome.files if path.parent == decks.lammps] == [
        "balls.data",
        "cast.in",
    ]
    assert "mpirun -np 8 liggghts -in cast.in" in outcome.rows[1][1]
    assert not (tmp_path / "out").exists()
    balls = outcome.document["balls"]
    for folder in decks:
        assert f"{balls} atoms" in (folder / "balls.data").read_text()
    bench = written(tmp_path, np.tile(0.5 * X, (len(Y), 1)))
    with pytest.raises(SpecError, match=r"LAMMPS deck: \d+ facets: .* or LIGGGHTS"):
        run_muckpile(bench, tmp_path / "out", decks=decks, **options)
    run_muckpile(bench, tmp_path / "out", decks=decks._replace(lammps=None), **options)
    assert (tmp_path / "liggghts" / "walls1.stl").read_text().count("endfacet") > 256
