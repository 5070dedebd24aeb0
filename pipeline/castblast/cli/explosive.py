"""`castblast explosive`: the catalogue, and the checks of a user's own explosive."""

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from castblast.cli.screen import Screen
from castblast.cli.verb import verb

app = typer.Typer(help="The catalogue of explosives and their checks.", no_args_is_help=True)

_Name = Annotated[str, typer.Argument(help="Name in the catalogue, or an explosive file.")]


@verb(app, "list")
def list_(screen: Screen) -> Mapping[str, Any]:
    """List the explosives that come with castblast."""
    from castblast.stages.explosives import catalogue

    entries = catalogue()
    screen.table(
        ("name", "density [kg/m3]", "VoD [m/s]", "heat [MJ/kg]", "CJ [GPa]", "explosion [GPa]"),
        [
            (
                entry["name"],
                f"{entry['density']:.0f}",
                f"{entry['detonation_velocity']:.0f}",
                f"{entry['heat_of_explosion'] * 1e-6:.2f}",
                f"{entry['cj_pressure'] * 1e-9:.2f}",
                f"{entry['explosion_pressure'] * 1e-9:.2f}",
            )
            for entry in entries
        ],
    )
    return {"explosives": entries}


@verb(app)
def show(screen: Screen, name: _Name) -> Mapping[str, Any]:
    """Show one explosive: states, energies, where its numbers come from."""
    from castblast.stages.explosives import describe

    description = describe(name)
    for key, value in description.items():
        screen.say(f"{key.replace('_', ' ')}: {value}")
    return description


@verb(app)
def check(screen: Screen, name: _Name) -> Mapping[str, Any]:
    """Check that an explosive's numbers belong together (exit code 4 if they do not)."""
    from castblast.stages.explosives import check_explosive

    outcome = check_explosive(name)
    screen.table(("relation", "value", "allowed", "verdict"), outcome.rows, title=outcome.title)
    if outcome.rejected:
        screen.exit_code = 4
        for line in outcome.rejected:
            screen.note(f"error: {line}")
    return outcome.document
