"""`castblast explosive`: the catalogue, and the checks of a user's own explosive."""

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from castblast.cli.screen import Screen
from castblast.cli.verb import verb
from castblast.names import as_words

app = typer.Typer(help="The catalogue of explosives and their checks.", no_args_is_help=True)

#: What `show` prints: unit for people and factor from SI.
_SHOWN = {
    "density": ("kg/m3", 1.0),
    "detonation_velocity": ("m/s", 1.0),
    "in_hole_velocity_150_mm": ("m/s", 1.0),
    "heat_of_explosion": ("MJ/kg", 1e-6),
    "total_energy": ("MJ/l", 1e-9),
    "energy_at_explosion_state": ("MJ/l", 1e-9),
    "cj_pressure": ("GPa", 1e-9),
    "explosion_pressure": ("GPa", 1e-9),
    "constant_volume_pressure": ("GPa", 1e-9),
    "work": ("MJ/kg", 1e-6),
    "relative_volume": ("1", 1.0),
    "exponent": ("1", 1.0),
}

_Name = Annotated[str, typer.Argument(help="Name in the catalogue, or an explosive file.")]


@verb(app, "list", example="explosive list")
def list_(screen: Screen) -> Mapping[str, Any]:
    """List the explosives that come with castblast."""
    from castblast.api.catalogue import catalogue

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


@verb(app, needs=("simulate",), example="explosive show anfo")
def show(screen: Screen, name: _Name) -> Mapping[str, Any]:
    """Show one explosive: states, energies and sources."""
    from castblast.stages.explosives import describe

    description = describe(name)
    rows = [
        (f"{as_words(key)} {part}".strip(), f"{value * factor:.5g}", unit)
        for key, (unit, factor) in _SHOWN.items()
        for part, value in _parts(description[key])
    ]
    title = f"{description['name']} ({description['form']})"
    screen.table(("quantity", "value", "unit"), rows, title=title)
    derived = ", ".join(as_words(key) for key in description["derived"])
    texts = (description["source"], derived, description["notes"])
    for label, text in zip(("Source", "Derived by this project", "Notes"), texts, strict=True):
        if text:
            screen.say(f"{label}: {text}")
    return description


def _parts(value: float | Mapping[str, float] | None) -> list[tuple[str, float]]:
    """A number, or numbers by the state they belong to; nothing if it is not known."""
    if value is None:
        return []
    return list(value.items()) if isinstance(value, Mapping) else [("", value)]


@verb(app, needs=("simulate",), example="explosive check mine/explosives/anfo.yaml")
def check(screen: Screen, name: _Name) -> Mapping[str, Any]:
    """Check that an explosive's numbers are consistent (exit code 4 if not)."""
    from castblast.stages.explosives import check_explosive

    return screen.show(check_explosive(name))
