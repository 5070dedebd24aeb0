"""`Network` to a web page: one HTML file that works from disk with the network off.

The page carries the module that `to_javascript` writes, so its numbers are the numbers of every
other copy; the scripts beside it only ask, draw and explain. A policy inside the page forbids
every request to elsewhere.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from castblast.bands import THROW_FACTOR, THROW_SD, prediction_factor, throw_band_factor
from castblast.design.rule import COMPLETED, rules_as_data
from castblast.design.variables import VARIABLES
from castblast.errors import SpecError
from castblast.export.source.answers import Answers
from castblast.export.source.javascript import to_javascript
from castblast.export.source.plain import Files, compact, render
from castblast.export.source.runners import run_js
from castblast.network import Network
from castblast.types import FloatArray, IntArray

PAGE = "index.html"
_FOLDER = Path(__file__).parent / "templates" / "web"
#: In the order in which they need each other; names at their top level differ.
_SCRIPTS = (
    "units", "rule", "design", "histories", "answers", "domain", "drawing", "figures", "table",
    "batch", "controls", "page",
)  # fmt: skip
#: Units that a table of designs may be written in, as people spell them.
_UNITS = {
    "m": ("m", "mm", "cm", "km", "in", "ft"),
    "Pa": ("Pa", "kPa", "MPa", "GPa", "bar", "kbar", "psi"),
    "rad": ("rad", "deg", "°"),
    "1": ("1", "%", "percent"),
    "kg m-3": ("kg m-3", "kg/m3", "kg/m^3", "kg/m³", "g/cm3", "g/cm³", "g/cc", "t/m3", "lb/ft3"),
}
_IMPORT = re.compile(r"^import .*?;\n", re.MULTILINE | re.DOTALL)
_EXPORT = re.compile(r"^export ", re.MULTILINE)
_BEGIN, _END = "/* model.js begins */\n", "/* model.js ends */\n"


def to_web(network: Network, histories: Mapping[str, Any] | None = None) -> Files:
    """Write ``index.html``.

    Parameters
    ----------
    network : Network
    histories : mapping, optional
        What `castblast.surrogate.history_modes.fit_history_modes` gives; without it the page has
        no pressure-time curve and no energy bars, and says so.
    """
    model = to_javascript(network)["model.js"].decode()
    facts = json.dumps(_facts(network, histories), separators=(",", ":"), allow_nan=False)
    facts = facts.replace("<", "\\u003c")  # no text of it can begin a tag
    script = f"{_BEGIN}{model}{_END}const facts = {facts};\n" + "".join(map(_script, _SCRIPTS))
    text = render(
        "web/page.html.j2",
        n=compact(network),
        held=_held_lines(network),
        throw={"factor": THROW_FACTOR, "sd": THROW_SD},
        css=(_FOLDER / "page.css").read_text(encoding="utf-8"),
        # A script ends at the first such tag, wherever it stands.
        script=script.replace("</", "<\\/"),
    )
    return {PAGE: text}


def run_web(
    network: Network, files: Files, numeric: FloatArray, index: IntArray
) -> tuple[Answers, str]:
    """Take the model out of the page and run it in node."""
    text = files[PAGE].decode().split(_BEGIN)[1].split(_END)[0]
    found, tool = run_js(network, {"model.js": text.encode()}, numeric, index)
    return found, f"{tool}, taken out of the page"


def _script(name: str) -> str:
    """One module without imports and exports: in the page they share one scope."""
    text = (_FOLDER / f"{name}.js").read_text(encoding="utf-8")
    return _EXPORT.sub("", _IMPORT.sub("", text))


def _facts(network: Network, histories: Mapping[str, Any] | None) -> dict[str, Any]:
    """What the page knows beside the network."""
    held = network.provenance.get("held_inputs", {})
    return {
        "explosives": {name: _explosive(name) for name in network.explosives},
        "throw": _throw(network),
        "explosionPressureFactor": prediction_factor("explosion_pressure"),
        # What follows from other inputs is completed, as `predict` does.
        "held": {n: v for n, v in held.items() if n in VARIABLES and n not in COMPLETED},
        "rule": rules_as_data(),
        "table": _table_facts(network),
        "variables": {
            name: {
                "title": v.long_name.split(";")[0],
                "unit": v.unit,
                "shown": v.file_unit,
                "factor": v.display_factor,
                "role": v.role,
                "lower": v.lower,
                "upper": v.upper,
            }
            for name, v in VARIABLES.items()
        },
        "scores": network.provenance.get("scores", {}).get("test", {}),
        "histories": histories,
    }


def _table_facts(network: Network) -> dict[str, Any]:
    """What tables of designs may say: heads of ids, units to SI, names of explosives."""
    from castblast.specs.catalogue import explosive_aliases, spelled
    from castblast.specs.tables.table import ID_HEADS
    from castblast.specs.units import unit_factor

    names = {spelled(name): name for name in network.explosives}
    known = {alias: names[spelled(own)] for alias, own in explosive_aliases().items()
             if spelled(own) in names}  # fmt: skip
    return {
        "ids": ID_HEADS,
        "units": {
            unit: {written: unit_factor(written, unit) for written in spellings}
            for unit, spellings in _UNITS.items()
        },
        "explosives": known | names,
    }


def _throw(network: Network) -> dict[str, float] | None:
    """Throw over free flight, and the ends of its prediction band over the throw."""
    bands = {column.name: column.relative_band for column in network.outputs}
    if "burden_velocity" not in bands:
        return None
    factor = throw_band_factor(bands["burden_velocity"])
    return {"factor": THROW_FACTOR, "less": 1.0 / factor, "more": factor}


def _held_lines(network: Network) -> list[str]:
    """What was held in training, for people; solver settings are no part of a design."""
    held = network.provenance.get("held_inputs", {})
    lines = []
    for name, value in held.items():
        variable = VARIABLES.get(name)
        if variable is not None and variable.role != "solver":
            title = variable.long_name.split(";")[0]
            lines.append(f"{title[0].upper()}{title[1:]}: {variable.show(value)}")
    return lines


def _explosive(name: str) -> dict[str, float] | None:
    """Numbers of a catalogue explosive in SI; None if the catalogue does not have it."""
    from castblast.explosive.isentrope import pressure
    from castblast.specs.catalogue import resolve_explosive
    from castblast.specs.explosive import load_explosive

    # A name of a record is no path: whoever wrote it must not choose what is read here.
    known = resolve_explosive(name)
    if known is None:
        return None
    try:
        spec = load_explosive(known)
        explosive = spec.to_explosive()
    except SpecError:
        return None
    state = spec.cj_state()
    numbers = {
        "density": explosive.density,
        "detonationVelocity": explosive.detonation_velocity,
        "explosionPressure": float(pressure(explosive.isentrope, 1.0)),
        "totalEnergy": explosive.total_energy,
        "diameterCoefficient": explosive.diameter_coefficient,
        "diameterExponent": explosive.diameter_exponent,
    }
    return numbers | ({} if state is None else {"cjPressure": state.pressure})
