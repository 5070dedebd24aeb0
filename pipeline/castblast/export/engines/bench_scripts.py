"""`Network` to PFC and LAMMPS: the Python file and what throws a bench of blocks with it.

Neither program evaluates a network in its own input language at any reasonable length (LAMMPS has
no tanh, FISH no matrices worth the name), so both get the answer from the Python file: PFC inside
its interpreter, LAMMPS from an include file that the script writes before the run.
"""

from __future__ import annotations

import csv
import io

from castblast.errors import SpecError
from castblast.export.source.plain import Files, compact, identity, render
from castblast.export.source.python import VELOCITY, to_python
from castblast.names import cell_text
from castblast.network import Network, evaluate_rows, in_domain
from castblast.types import FloatArray

#: Heads of the CSV file of a bench, before the inputs.
BENCH_HEAD = ("group", "explosive", "direction_x", "direction_y", "direction_z")
#: LAMMPS knows 32 groups, `all` among them.
LAMMPS_GROUPS = 31


def to_pfc(network: Network) -> Files:
    """Write ``model.py``, ``pfc_bench.py``, ``pfc_bench.dat`` and an example ``bench.csv``.

    Raises
    ------
    SpecError
        The network gives no burden velocity.
    """
    bench = _example_bench(network, "pfc")
    speeds = _speeds(network, bench)
    values = {"model": identity(network), "blocks": speeds}
    return to_python(network) | {
        "bench.csv": bench_csv(network, bench).encode(),
        "pfc_bench.py": render("pfc_bench.py.j2", **values),
        "pfc_bench.dat": render("pfc_bench.dat.j2", **values),
    }


def to_lammps(network: Network) -> Files:
    """Write ``model.py``, ``lammps_bench.py``, ``lammps_bench.in`` and an example ``bench.csv``.

    Raises
    ------
    SpecError
        The network gives no burden velocity.
    """
    bench = _example_bench(network, "lammps")
    values = {"n": compact(network), "model": identity(network), "groups": LAMMPS_GROUPS}
    return to_python(network) | {
        "bench.csv": bench_csv(network, bench).encode(),
        "lammps_bench.py": render("lammps_bench.py.j2", **values),
        "lammps_bench.in": render("lammps_bench.in.j2", **values),
    }


def _example_bench(network: Network, target: str) -> list[tuple[str, int, list[float]]]:
    """Two blocks from golden rows inside the domain: group, explosive, inputs."""
    if VELOCITY not in network.output_names:
        message = f"export target '{target}': throws blocks, but this network gives no {VELOCITY}"
        raise SpecError(message)
    rows: FloatArray = network.golden.inputs
    rows = rows[in_domain(network, rows)][-2:]
    if not len(rows):
        rows = network.golden.inputs[-2:]
    return [(f"block_{j}", 0, row) for j, row in enumerate(rows.tolist(), 1)]


def _speeds(network: Network, bench: list[tuple[str, int, list[float]]]) -> list[tuple[str, float]]:
    import numpy as np

    if not bench:
        return []
    index = np.array([kind for _, kind, _ in bench], dtype=np.int64)
    values = evaluate_rows(network, np.array([row for *_, row in bench]), index)
    column = network.output_names.index(VELOCITY)
    return [(name, float(v)) for (name, *_), v in zip(bench, values[:, column], strict=True)]


def bench_csv(network: Network, bench: list[tuple[str, int, list[float]]]) -> str:
    """Write the CSV file of a bench whose blocks all move along x."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*BENCH_HEAD, *network.input_names])
    for group, kind, row in bench:
        writer.writerow(
            [group, cell_text(network.explosives[kind]), 1.0, 0.0, 0.0, *map(repr, row)]
        )
    return stream.getvalue()
