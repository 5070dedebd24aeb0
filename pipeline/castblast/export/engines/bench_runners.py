"""Run the bench scripts for PFC and LAMMPS: the velocity that a ball of each golden row gets.

LAMMPS is run itself. PFC is commercial: a stand-in of its module `itasca`, with the three calls
that the script makes, takes its place.
"""

from __future__ import annotations

import shutil

import numpy as np

from castblast.errors import CheckError
from castblast.export.engines.bench_scripts import LAMMPS_GROUPS, bench_csv
from castblast.export.source.answers import Answers, NotVerifiedError
from castblast.export.source.plain import Files
from castblast.export.source.python import VELOCITY
from castblast.export.source.runners import oldest_python, run_program, run_python, written
from castblast.network import Network
from castblast.types import FloatArray, IntArray

_ITASCA = """
class Ball:
    def __init__(self, group):
        self.group, self.velocity = group, None
    def in_group(self, name, slot):
        return slot == "block" and name == self.group
    def set_vel(self, velocity):
        self.velocity = velocity

class ball:
    balls = []
    @classmethod
    def list(cls):
        return iter(cls.balls)
"""

_THROW = """
import itasca, model
designs = model.read_designs("golden.csv")
itasca.ball.balls = [itasca.Ball(design["group"]) for design in designs]
model.set_ball_velocities(designs, allow_outside=True)
for ball in itasca.ball.list():
    print(" ".join(repr(x) for x in ball.velocity))
"""


def run_pfc(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Answers of the Python file; velocities as balls get them from it."""
    answers, tool = run_python(network, files, numeric, index)
    extra = {
        "golden.csv": _bench(network, numeric, index).encode(),
        "itasca.py": _ITASCA.encode(),
        "throw.py": _THROW.encode(),
    }
    with written({**files, **extra}) as folder:
        text = run_program([oldest_python()[0], "throw.py"], folder=folder)
    velocities = np.array([line.split() for line in text.splitlines()], dtype=np.float64)
    return _with_velocities(network, answers, velocities), f"{tool} and a stand-in of itasca"


def run_lammps(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Answers of the Python file; velocities as atoms have them in LAMMPS."""
    lammps = shutil.which("lmp")
    if lammps is None:
        message = "LAMMPS (lmp) is not installed"
        raise NotVerifiedError(message)
    answers, tool = run_python(network, files, numeric, index)
    with written(files) as folder:
        lines = _atoms(len(numeric))
        for start in range(0, len(numeric), LAMMPS_GROUPS):
            stop = min(start + LAMMPS_GROUPS, len(numeric))
            table, include = f"golden_{start}.csv", f"velocities_{start}.in"
            part = slice(start, stop)
            (folder / table).write_text(_bench(network, numeric[part], index[part]))
            script = ["lammps_bench.py", table, include, "--allow-outside"]
            run_program([oldest_python()[0], *script], folder=folder)
            names = [f"row_{j}" for j in range(stop - start)]
            lines += [f"group {name} id {start + j + 1}" for j, name in enumerate(names)]
            lines += [f"include {include}", *(f"group {name} delete" for name in names)]
        dump = 'write_dump all custom golden.dump id vx vy vz modify sort id format float "%.17g"'
        (folder / "golden.in").write_text("\n".join([*lines, dump]) + "\n")
        run_program([lammps, "-in", "golden.in", "-log", "none"], folder=folder)
        velocities = np.loadtxt(folder / "golden.dump", skiprows=9, ndmin=2)[:, 1:]
    return _with_velocities(network, answers, velocities), f"{tool} and LAMMPS"


def _atoms(count: int) -> list[str]:
    """Input lines for a row of single atoms."""
    return [
        "units si",
        "atom_style sphere",
        "boundary f f f",
        f"region box block 0 {count + 1} -1 1 -1 1",
        "create_box 1 box",
        *(f"create_atoms 1 single {j + 1} 0 0" for j in range(count)),
        "set group all diameter 0.5 density 2600.0",
    ]


def _bench(network: Network, numeric: FloatArray, index: IntArray) -> str:
    kinds = zip(index.tolist(), numeric.tolist(), strict=True)
    return bench_csv(network, [(f"row_{j}", kind, row) for j, (kind, row) in enumerate(kinds)])


def _with_velocities(network: Network, answers: Answers, velocities: FloatArray) -> Answers:
    """Put the speed along x of every ball in place of the predicted burden velocity."""
    if velocities.shape != (len(answers.values), 3) or np.any(velocities[:, 1:] != 0.0):
        message = "the balls do not move along the direction that was given"
        raise CheckError(message)
    values = answers.values.copy()
    values[:, network.output_names.index(VELOCITY)] = velocities[:, 0]
    return answers._replace(values=values)
