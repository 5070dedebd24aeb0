"""`castblast muckpile`: cast a bench with the discrete-element model."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import PILES, OutFolder
from castblast.cli.screen import Screen
from castblast.cli.verb import verb
from castblast.errors import SpecError

_Ore = Annotated[
    Path | None,
    typer.Option(
        help="Ore polygons (YAML or CSV): ore loss, dilution and where the ore lies.",
        show_default=False,
    ),
]
_DigBlock = Annotated[
    str | None,
    typer.Option(help='Side of a dig block, "3 m"; default: spacing.', show_default=False),
]
_Flitch = Annotated[
    str | None,
    typer.Option(
        help='Height of a dig block, "2.5 m"; default: the whole pile.', show_default=False
    ),
]


def muckpile(
    screen: Screen,
    bench: Annotated[
        str, typer.Argument(help="Bench file (YAML), or the name of one that ships with castblast.")
    ],
    out: OutFolder = None,
    balls: Annotated[
        int | None,
        typer.Option(
            min=10, help="About this many balls (changes their size).", show_default=False
        ),
    ] = None,
    threads: Annotated[
        int | None, typer.Option(min=1, help="Threads; default: all cores.", show_default=False)
    ] = None,
    velocity: Annotated[
        str | None,
        typer.Option(
            help='Burden velocity, "12.7 m/s" (overrides the bench file).', show_default=False
        ),
    ] = None,
    precision: Annotated[
        str | None,
        typer.Option(
            metavar="mixed|float64",
            help="Precision (overrides the bench file).",
            show_default=False,
        ),
    ] = None,
    packings: Annotated[
        Path | None,
        typer.Option(
            help="Folder of packings to reuse and add to; default: in the output folder.",
            show_default=False,
        ),
    ] = None,
    seeds: Annotated[
        int,
        typer.Option(
            min=1, help="Repeat with this many seeds; report mean and standard deviation."
        ),
    ] = 1,
    ore: _Ore = None,
    dig_block: _DigBlock = None,
    flitch: _Flitch = None,
    animation: Annotated[
        str | None, typer.Option(metavar="gif|mp4", help="Write an animation.", show_default=False)
    ] = None,
    vtk: Annotated[bool, typer.Option("--vtk", help="Write .vtp frames and a .pvd.")] = False,
    vtkhdf: Annotated[
        bool, typer.Option("--vtkhdf", help="Write all frames to a .vtkhdf.")
    ] = False,
    frame_interval: Annotated[
        str, typer.Option(help="Simulated time between two frames.")
    ] = "0.1 s",
    lammps: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write the packed bench as input for LAMMPS instead of running it.",
            show_default=False,
        ),
    ] = None,
    liggghts: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="The same for LIGGGHTS.", show_default=False),
    ] = None,
) -> Mapping[str, Any]:
    """Pack, fire and settle a bench; write final state, profile, pictures and metrics."""
    from castblast.stages.muckpile.compare import run_seeds
    from castblast.stages.muckpile.deck import Decks
    from castblast.stages.muckpile.extras import Extras
    from castblast.stages.muckpile.run import run_muckpile

    decks = Decks(lammps, liggghts)
    if decks.wanted and seeds > 1:
        raise SpecError("--seeds: a deck is written of one seed; leave --seeds out")
    options: dict[str, Any] = {
        "balls": balls,
        "threads": threads,
        "velocity": velocity,
        "precision": precision,
        "packings": packings,
        "extras": Extras(
            ore=ore,
            dig_block=dig_block,
            flitch=flitch,
            animation=animation,
            vtk=vtk,
            vtkhdf=vtkhdf,
            frame_interval=frame_interval,
        ),
        "decks": decks,
    }
    with screen.progress("muckpile") as progress:
        if seeds > 1:
            outcome = run_seeds(bench, out, seeds, progress=progress, **options)
        else:
            outcome = run_muckpile(bench, out, progress=progress, **options)
    return screen.show(outcome)


def compare_muckpiles(
    screen: Screen,
    folders: Annotated[list[Path], typer.Argument(help="Folders of finished muckpile runs.")],
    out: OutFolder = None,
) -> Mapping[str, Any]:
    """Compare finished muckpiles: mean and scatter of every metric, overlaid profiles."""
    from castblast.stages.muckpile.compare import compare_runs

    return screen.show(compare_runs(folders, Path() if out is None else out))


def measure_muckpile(
    screen: Screen,
    bench: Annotated[str, typer.Argument(help="Bench file (YAML), or the name of one.")],
    final: Annotated[
        Path, typer.Argument(help="Balls at the end: final.dump of a deck, or a file of balls.")
    ],
    out: OutFolder = None,
    start: Annotated[
        Path | None,
        typer.Option(
            help="The same balls before firing; default: those of the bench file, or balls.data "
            "beside FINAL.",
            show_default=False,
        ),
    ] = None,
    ore: _Ore = None,
    dig_block: _DigBlock = None,
    flitch: _Flitch = None,
) -> Mapping[str, Any]:
    """Measure another engine's muckpile: throw, profile and ore from its final balls."""
    from castblast.stages.muckpile.extras import Extras
    from castblast.stages.muckpile.measure import measure_muckpile as measure

    extras = Extras(ore=ore, dig_block=dig_block, flitch=flitch)
    return screen.show(measure(bench, final, out, start=start, extras=extras))


def add_to(app: typer.Typer) -> None:
    """Register the verbs."""
    needs = ("simulate", "plot")
    example = "muckpile demo --balls 2000 --out muckpile"
    verb(app, needs=needs, compiles="muckpile", panel=PILES, example=example)(muckpile)
    example = "measure-muckpile demo deck/final.dump --out measured"
    verb(app, needs=needs, panel=PILES, example=example)(measure_muckpile)
    example = "compare-muckpiles muckpile other_muckpile"
    verb(app, needs=needs, panel=PILES, example=example)(compare_muckpiles)
