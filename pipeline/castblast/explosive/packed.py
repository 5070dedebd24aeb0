"""Several isentropes in plain arrays, for kernels that serve rows of different explosives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from castblast.explosive.isentrope import ProductIsentrope, jwl_pressure, pressure
from castblast.kernel import kernel
from castblast.types import BoolArray, FloatArray, IntArray


class PackedIsentropes(NamedTuple):
    """Isentropes of k explosives.

    Attributes
    ----------
    tabulated : bool array (k,)
    constants : array (k, 6)
        a, b, c [Pa], r1, r2, omega [-] of `ProductIsentrope`.
    points : int array (k,)
        Points of each table.
    tables : array (k, 4, m)
        Its columns log_volume, log_pressure, log_slope, energy, filled up with zeros.
    """

    tabulated: BoolArray
    constants: FloatArray
    points: IntArray
    tables: FloatArray


def pack_isentropes(isentropes: Sequence[ProductIsentrope]) -> PackedIsentropes:
    """Put isentropes into arrays."""
    points = np.array([i.log_volume.size for i in isentropes], dtype=np.int64)
    tables = np.zeros((len(points), 4, int(points.max(initial=1))))
    for k, i in enumerate(isentropes):
        tables[k, :, : points[k]] = i.log_volume, i.log_pressure, i.log_slope, i.energy
    constants = [(i.a, i.b, i.c, i.r1, i.r2, i.omega) for i in isentropes]
    return PackedIsentropes(
        np.array([i.tabulated for i in isentropes], dtype=np.bool_),
        np.array(constants, dtype=np.float64).reshape(-1, 6),
        points,
        tables,
    )


@kernel
def unpack_isentrope(packed: PackedIsentropes, k: int) -> ProductIsentrope:
    """Isentrope of explosive `k`."""
    c = packed.constants[k]
    table = packed.tables[k, :, : packed.points[k]]
    return ProductIsentrope(
        tabulated=packed.tabulated[k], a=c[0], b=c[1], c=c[2], r1=c[3], r2=c[4], omega=c[5],
        log_volume=table[0], log_pressure=table[1], log_slope=table[2], energy=table[3],
    )  # fmt: skip


@kernel
def packed_pressure(packed: PackedIsentropes, k: int, relative_volume: float) -> float:
    """Pressure [Pa] of explosive `k` at a relative volume > 0; as `isentrope.pressure`."""
    if packed.tabulated[k]:
        return pressure(unpack_isentrope(packed, k), relative_volume)
    c = packed.constants
    return jwl_pressure(c[k, 0], c[k, 1], c[k, 2], c[k, 3], c[k, 4], c[k, 5], relative_volume)
