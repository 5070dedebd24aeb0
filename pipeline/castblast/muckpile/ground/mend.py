"""Mending of triangulated surfaces as mine tools and scanners write them.

A ball feels a surface through facets that share corners and edges and face it. Files have corners a
fraction of a millimetre apart, facets twice, facets without height, and facets turned round. Those
are joined, dropped and turned here, and each is counted, so that nothing happens unsaid; what is
left to `castblast.muckpile.ground.terrain.surface_faults` cannot be mended without knowing the
ground: holes, and edges at which more than two facets meet.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from castblast.muckpile.ground.facet_table import corner_numbers, edge_numbers
from castblast.types import BoolArray, FloatArray, IntArray

#: Corners closer together than this [m] are one, and facets lower than this have no height.
WELD = 1e-3
#: The same over the median side of the facets, for small surfaces.
_WELD_SHARE = 0.01
#: Share of its area that a surface must show to the sky for "up" to be a side of it.
_LEVEL_SHARE = 0.02
_PASSES = 10
#: Rims closer together than this, over the median side, look as if they belonged together.
_CRACK_SHARE, _WIDEST_CRACK = 0.1, 0.1


class Repair(NamedTuple):
    """One kind of repair: the facets or corners it met, by number, and words for it.

    Attributes
    ----------
    what : str
        What was wrong, such as ``"had no height"``.
    done : str
        What was done about it: ``"dropped"``.
    facet : array (n,), int64
        Numbers in the file, rising.
    """

    what: str
    done: str
    facet: IntArray


class Mended(NamedTuple):
    """A surface, where its facets come from, and what was done to it.

    Attributes
    ----------
    corner : array (t, 3, 3) [m]
    source : array (t,), int64
        Number of each facet before.
    repairs : tuple of Repair
    """

    corner: FloatArray
    source: IntArray
    repairs: tuple[Repair, ...]


def weld_distance(corner: FloatArray) -> float:
    """Distance [m] below which corners of facets (t, 3, 3) [m] are taken for one.

    On an edge whose two facets do not share it a ball would meet both of them at once.
    """
    return min(WELD, _WELD_SHARE * median_side(corner)) if len(corner) else WELD


def median_side(corner: FloatArray) -> float:
    """Median length [m] of the sides of facets (t, 3, 3) [m], t > 0."""
    return float(np.median(np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2)))


def weld(corner: FloatArray, distance: float) -> tuple[FloatArray, BoolArray]:
    """Join corners that lie within `distance` [m] of each other.

    Returns
    -------
    corner : array (t, 3, 3) [m]
        Joined corners are at their mean; all others keep every bit.
    moved : array (t,), bool
        Facets with a joined corner.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    places, number = np.unique(corner.reshape(-1, 3), axis=0, return_inverse=True)
    near = np.zeros((0, 2), np.int64)
    if distance > 0.0:
        near = cKDTree(places).query_pairs(distance, output_type="ndarray")
    if not len(near):
        return corner, np.zeros(len(corner), np.bool_)
    graph = coo_array((np.ones(len(near), np.int8), (near[:, 0], near[:, 1])), (len(places),) * 2)
    label = connected_components(graph, directed=False)[1]
    members = np.bincount(label)
    joined = members[label] > 1
    mean = np.stack([np.bincount(label, places[:, a]) / members for a in range(3)], axis=1)
    places[joined] = mean[label[joined]]
    number = number.reshape(-1, 3)
    return places[number], np.asarray(joined[number].any(axis=1), np.bool_)


def mend(corner: FloatArray, distance: float, towards: FloatArray | None = None) -> Mended:
    """Join corners, drop facets that are none, and turn facets that face the wrong way.

    A surface that can be seen from above faces up, a closed one outwards, a wall `towards` a point.

    Parameters
    ----------
    corner : array (t, 3, 3) [m]
        Finite.
    distance : float [m]
        See `weld`; facets lower than this are dropped, and a neighbour along their longest side is
        split at their tip, so that no seam opens.
    towards : array (3,), optional [m]
    """
    welded, moved = weld(corner, distance)
    repairs = [Repair("had corners just beside those of others", "joined", np.flatnonzero(moved))]
    source = np.arange(len(welded))
    welded, source, flat = _without_flat(welded, source, distance)
    repairs.append(Repair("had no height", "dropped", flat))
    number, _ = corner_numbers(welded)
    _, first = np.unique(np.sort(number, axis=1), axis=0, return_index=True)
    first = np.sort(first)
    doubled = np.delete(source, first)
    repairs.append(Repair("lay on another with the same corners", "dropped", doubled))
    welded, source = welded[first], source[first]
    turned = _turned(welded, towards)
    welded[turned] = welded[turned][:, ::-1]
    repairs.append(Repair("faced away from the balls", "turned", np.unique(source[turned])))
    return Mended(welded, source, tuple(r for r in repairs if len(r.facet)))


def _heights(corner: FloatArray) -> tuple[FloatArray, IntArray]:
    """Least height (t,) [m] of each facet, and which side (t,) is the longest."""
    side = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2)
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    longest = side.argmax(axis=1)
    base = np.maximum(side.max(axis=1), 1e-300)
    return np.linalg.norm(across, axis=1) / base, longest


def _without_flat(
    corner: FloatArray, source: IntArray, distance: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """Drop facets without height; returns what is left, its sources, and what went."""
    number, _ = corner_numbers(corner)
    point = (number == np.roll(number, -1, axis=1)).any(axis=1)
    gone = [source[point]]
    corner, source = corner[~point], source[~point]
    for _ in range(_PASSES):
        height, longest = _heights(corner)
        bad = np.flatnonzero(height <= distance)
        if not len(bad):
            break
        keep, split, split_source = _split_beside(corner, source, bad, longest)
        gone.append(np.setdiff1d(source[~keep], split_source))
        corner = np.concatenate([corner[keep], split])
        source = np.concatenate([source[keep], split_source])
    return corner, source, np.unique(np.concatenate(gone))


def _split_beside(
    corner: FloatArray, source: IntArray, bad: IntArray, longest: IntArray
) -> tuple[BoolArray, FloatArray, IntArray]:
    """Which facets stay, and the halves of those that a flat facet borders with its long side."""
    number, _ = corner_numbers(corner)
    edge, _, meeting = edge_numbers(number)
    order = np.argsort(edge.ravel(), kind="stable")
    start = np.searchsorted(edge.ravel()[order], np.arange(len(meeting) + 1))
    keep = np.ones(len(corner), np.bool_)
    halves: list[FloatArray] = []
    sources: list[int] = []
    for k in bad.tolist():
        if not keep[k]:
            continue
        side = int(longest[k])
        e = edge[k, side]
        beside = [f for f in (order[start[e] : start[e + 1]] // 3).tolist() if f != k]
        lone = all(meeting[edge[k, (side + a) % 3]] == 1 for a in (1, 2))
        if len(beside) == 1 and not lone:
            other = beside[0]
            if not keep[other]:
                continue  # its halves are looked at in the next pass
            tip = corner[k, (side + 2) % 3]
            at = int(np.flatnonzero(edge[other] == e)[0])
            a, b, c = (corner[other, (at + i) % 3] for i in range(3))
            halves += [np.stack([a, tip, c]), np.stack([tip, b, c])]
            sources += [int(source[other])] * 2
            keep[other] = False
        keep[k] = False
    split = np.array(halves).reshape(-1, 3, 3)
    return keep, split, np.array(sources, dtype=np.int64)


def _turned(corner: FloatArray, towards: FloatArray | None) -> BoolArray:
    """Facets that must be turned so that each connected piece has one side, the right one.

    Two copies of every facet, one turned, are joined across each edge so that both sides agree;
    each piece then falls into two mirror images, of which one is chosen.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(corner)
    if not count:
        return np.zeros(0, np.bool_)
    number, _ = corner_numbers(corner)
    edge, _, meeting = edge_numbers(number)
    inner = np.flatnonzero((meeting == 2)[edge.ravel()])
    pair = inner[np.argsort(edge.ravel()[inner], kind="stable")].reshape(-1, 2)
    forward = (number < np.roll(number, -1, axis=1)).ravel()[pair]
    one, two = pair.T // 3
    # Neighbours agree if they run along their edge in opposite directions.
    other = np.where(forward[:, 0] != forward[:, 1], two, two + count)
    mirror = np.where(forward[:, 0] != forward[:, 1], two + count, two)
    ends = np.concatenate([one, one + count]), np.concatenate([other, mirror])
    graph = coo_array((np.ones(len(ends[0]), np.int8), ends), (2 * count, 2 * count))
    label = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
    kept, mirrored = label[:count], label[count:]
    votes = _votes(corner, number, edge, meeting, kept, mirrored, towards)
    # A piece with one side only has one image, and a single vote of zero: it stays as it is.
    return np.asarray(votes[mirrored] > votes[kept])


def _votes(
    corner: FloatArray,
    number: IntArray,
    edge: IntArray,
    meeting: IntArray,
    kept: IntArray,
    mirrored: IntArray,
    towards: FloatArray | None,
) -> FloatArray:
    """How much each image of each piece faces the way it should."""
    images = int(max(kept.max(), mirrored.max())) + 1
    across = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    middle = corner.mean(axis=1)

    def tally(each: FloatArray) -> FloatArray:
        found = np.bincount(kept, each, images) - np.bincount(mirrored, each, images)
        return np.asarray(found, np.float64)

    def per_piece(each: FloatArray) -> FloatArray:
        found = np.bincount(kept, each, images) + np.bincount(mirrored, each, images)
        return np.asarray(found, np.float64)

    area = per_piece(np.linalg.norm(across, axis=1))
    up = tally(across[:, 2])
    as_it_is = tally(np.linalg.norm(across, axis=1))
    upright = np.abs(up) <= _LEVEL_SHARE * area
    aside = as_it_is
    if towards is not None:
        seen = tally(np.sum(across * (towards - middle), axis=1))
        aside = np.where(np.abs(seen) > 1e-9 * area, seen, as_it_is)
    closed = per_piece((meeting[edge] == 1).any(axis=1).astype(np.float64)) == 0.0
    volume = tally(np.sum(across * (middle - middle.mean(axis=0)), axis=1))
    return np.where(closed, volume, np.where(upright, aside, up))


def cracks(corner: FloatArray, distance: float) -> tuple[int, float]:
    """Count corners of rims that lie close to another rim without being joined to it.

    Returns
    -------
    count : int
    gap : float [m]
        The widest of the gaps, which lie between `distance` and a tenth of the facets.
    """
    from scipy.spatial import cKDTree

    number, places = corner_numbers(corner)
    _, ends, meeting = edge_numbers(number)
    rim = ends[meeting == 1]
    if not len(rim):
        return 0, 0.0
    place = np.empty((places, 3))
    place[number] = corner
    at_rim = np.unique(rim)
    reach = min(_WIDEST_CRACK, _CRACK_SHARE * median_side(corner))
    near = cKDTree(place[at_rim]).query_pairs(reach, output_type="ndarray")
    known = np.sort(ends, axis=1)
    pair = np.sort(at_rim[near], axis=1)
    span = np.int64(places)
    apart = ~np.isin(pair[:, 0] * span + pair[:, 1], known[:, 0] * span + known[:, 1])
    if not apart.any():
        return 0, 0.0
    gap = np.linalg.norm(place[pair[apart, 0]] - place[pair[apart, 1]], axis=1)
    return len(np.unique(pair[apart])), float(gap.max())
