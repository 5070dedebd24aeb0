"""`Network` to C99: a header and a source that need nothing but libm.

Tables are constant and every number stands with all its digits. No allocation, no state: one
object file serves any number of threads. Compiled with ``-DCASTBLAST_SELF_TEST`` the source is a
program that runs its own golden rows.
"""

from __future__ import annotations

from castblast.errors import SpecError
from castblast.export.source.plain import Files, compact, example_row, identifier, render
from castblast.network import Network

#: Flags under which the source must be silent.
STRICT_FLAGS = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")


def to_c(network: Network) -> Files:
    """Write ``model.h`` and ``model.c``.

    Raises
    ------
    SpecError
        Two names become the same identifier of C.
    """
    names = [*network.input_names, *network.output_names]
    names += [f"explosive_{name}" for name in network.explosives]
    seen: dict[str, str] = {
        word: "the header"
        for word in ("INPUTS", "OUTPUTS", "EXPLOSIVES", "INSIDE", "UNUSUAL", "OUTSIDE")
    }
    for name in names:
        other = seen.setdefault(identifier(name), name)
        if other != name:
            message = f"export target 'c': '{name}' and '{other}' become the same name in C"
            raise SpecError(message)
    values = {"n": compact(network), "example": example_row(network)}
    return {"model.h": render("model.h.j2", **values), "model.c": render("model.c.j2", **values)}
