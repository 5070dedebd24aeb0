"""Balls of a bench as written in its file: their number or size, and how sizes are spread."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from castblast.muckpile.bench.fragments import (
    CutSizes,
    SizeCurve,
    coarsest,
    cut_sizes,
    smallest_for_count,
)
from castblast.muckpile.bench.geometry import Bench, bench_volume
from castblast.muckpile.bench.packing import check_sizes, sizes_for_count, solid_volume
from castblast.muckpile.bench.sizes import Sizes, normal_sizes, uniform_sizes
from castblast.specs.bench.fragments import FragmentsSpec, fragment_curve
from castblast.specs.loading import Spec
from castblast.specs.quantity import QuantityError, QuantityIn

#: More than any machine of today throws in a week.
MOST_BALLS = 5_000_000
#: With more the smallest of a normal distribution would have no size.
_WIDEST_NORMAL = 0.4
_ROUNDS = 6
_MEAN_RADII = (0.005, 10.0)
_WIDEST = 0.8
#: Radii [m] that a bench file can bring about, and a file of balls may hold.
RADII = (_MEAN_RADII[0] * (1.0 - _WIDEST), _MEAN_RADII[1] * (1.0 + _WIDEST))


class BallsSpec(Spec):
    """Balls to pack (by mean radius, by number or by fragment sizes), or a file of balls.

    Attributes
    ----------
    mean_radius : float [m], optional
    count : int, optional
        About this many balls; their mean radius follows, or the smallest of the fragments.
    file : str, optional
        ``.npz`` or ``.csv`` of balls, relative to the bench file.
    distribution : {"uniform", "normal"}
        Of the radii, by number.
    relative_deviation : float [-]
        Radii are uniform in mean radius times 1 -+ this; normal: standard deviation over mean, cut
        at two of them.
    fragments : FragmentsSpec, optional
        Sizes by mass instead, with `count` or with the smallest fragment.
    solid_fraction : float [-]
    """

    mean_radius: Annotated[float, QuantityIn("m", *_MEAN_RADII)] | None = None
    count: Annotated[int, Field(ge=10, le=MOST_BALLS)] | None = None
    file: Annotated[str, Field(min_length=1)] | None = None
    distribution: Literal["uniform", "normal"] = "uniform"
    relative_deviation: Annotated[float, QuantityIn("1", 0.0, _WIDEST)] = 0.5
    fragments: FragmentsSpec | None = None
    solid_fraction: Annotated[float, QuantityIn("1", 0.55, 0.63)] = 0.60

    @model_validator(mode="after")
    def _one_size(self) -> BallsSpec:
        given = [name for name in ("mean_radius", "count", "file") if getattr(self, name)]
        faults = []
        if self.fragments is not None:
            if {"mean_radius", "file"} & set(given):
                faults.append("fragments: go with 'count' or 'fragments.smallest' only")
            elif (self.count is None) == (self.fragments.smallest is None):
                faults.append("exactly one of 'count' and 'fragments.smallest' is needed")
            if {"distribution", "relative_deviation"} & self.model_fields_set:
                faults.append("'distribution' and 'relative_deviation' mean nothing to fragments")
        elif len(given) != 1:
            faults.append("exactly one of 'mean_radius', 'count' and 'file' is needed")
        if self.distribution == "normal" and self.relative_deviation > _WIDEST_NORMAL:
            faults.append(
                f"relative_deviation {self.relative_deviation:g}: at most {_WIDEST_NORMAL:g} for a "
                f"normal distribution; give it explicitly"
            )
        if faults:
            raise QuantityError("; ".join(faults))
        return self

    def unit_sizes(self) -> Sizes:
        """Distribution of radii over their mean."""
        make = normal_sizes if self.distribution == "normal" else uniform_sizes
        return make(1.0, self.relative_deviation)


class ChosenSizes(NamedTuple):
    """Sizes of the balls of a bench, and the fragments that they stand for, if any."""

    sizes: Sizes
    cut: CutSizes | None = None
    curve: SizeCurve | None = None


def choose_sizes(spec: BallsSpec, bench: Bench, design: Mapping[str, Any]) -> ChosenSizes:
    """Turn what is written into sizes of balls.

    Parameters
    ----------
    spec : BallsSpec
        Without a file.
    bench : Bench
    design : mapping
        Explosive and variables [SI] that fragments may leave open.

    Raises
    ------
    ValueError
        The balls cannot be packed; the message names every fault.
    """
    chosen = _choose(spec, bench, design)
    if faults := check_sizes(bench, chosen.sizes, spec.solid_fraction):
        raise ValueError("; ".join(faults))
    return chosen


def _choose(spec: BallsSpec, bench: Bench, design: Mapping[str, Any]) -> ChosenSizes:
    if spec.fragments is None:
        sizes = spec.unit_sizes()
        if spec.mean_radius is not None:
            return ChosenSizes(sizes._replace(radius=sizes.radius * spec.mean_radius))
        return ChosenSizes(sizes_for_count(bench, sizes, spec.count or 0, spec.solid_fraction))
    curve = fragment_curve(spec.fragments, bench, design)
    largest = spec.fragments.largest or coarsest(curve)
    if spec.fragments.smallest is not None:
        cut = cut_sizes(curve, spec.fragments.smallest, largest)
        return ChosenSizes(cut.sizes, cut, curve)
    # What the balls leave free along the walls depends on their size, a little.
    solid = spec.solid_fraction * bench_volume(bench)
    for _ in range(_ROUNDS):
        cut = cut_sizes(curve, smallest_for_count(curve, largest, solid, spec.count or 0), largest)
        solid = solid_volume(bench, cut.sizes, spec.solid_fraction)
    return ChosenSizes(cut.sizes, cut, curve)
