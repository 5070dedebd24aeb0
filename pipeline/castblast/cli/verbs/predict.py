"""`castblast predict`: the instant answer of the chosen surrogate. Imports nothing heavy."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from castblast.cli.options import BLAST, Settings
from castblast.cli.screen import Screen
from castblast.cli.verb import verb

_Quantity = Annotated[str | None, typer.Option(metavar='"VALUE UNIT"', show_default=False)]


def predict(
    screen: Screen,
    explosive: Annotated[
        str, typer.Option(help="An explosive the network was trained on.")
    ] = "anfo",
    burden: _Quantity = None,
    bench_height: _Quantity = None,
    hole_diameter: _Quantity = None,
    charge_length: _Quantity = None,
    stemming_length: _Quantity = None,
    ucs: _Quantity = None,
    young_modulus: _Quantity = None,
    settings: Settings = None,
    csv: Annotated[
        Path | None,
        typer.Option(
            help="Designs as CSV, one per row; column headers like 'burden [m]'.",
            show_default=False,
        ),
    ] = None,
    network: Annotated[
        Path | None, typer.Option(help="A network.json, or: full, paper.", show_default="full")
    ] = None,
) -> Mapping[str, Any]:
    """Predict equilibrium pressure, hole expansion, crushed zone and burden velocity.

    Inputs that are not given take their defaults. Every value comes with its prediction band, from
    the 5th to the 95th percentile of blasts, a prior before calibration. Designs outside or at the
    edge of the training data are flagged, with the inputs responsible.
    """
    from castblast.specs.case import parse_values, split_assignments
    from castblast.stages.predict import predict_design

    options = {
        "burden": burden,
        "bench_height": bench_height,
        "hole_diameter": hole_diameter,
        "charge_length": charge_length,
        "stemming_length": stemming_length,
        "ucs": ucs,
        "young_modulus": young_modulus,
    }
    given = {name: value for name, value in options.items() if value is not None}
    given |= split_assignments(settings or [])
    if csv is not None:
        from castblast.stages.predict_table import predict_csv

        common = parse_values(given, "predict")
        table = predict_csv(csv, network, explosive=explosive, common=common)
        if screen.as_json:
            return {"rows": table.rows}
        screen.say(table.text.rstrip())
        return {}
    return screen.show(predict_design(given, explosive, network))


def add_to(app: typer.Typer) -> None:
    """Register the verb."""
    example = 'predict --explosive anfo --burden "4 m" --hole-diameter "150 mm" --ucs "80 MPa"'
    verb(app, panel=BLAST, example=example)(predict)
