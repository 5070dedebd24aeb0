"""What a surrogate record holds, and what makes one unusable.

A `Network` is a scaled feed-forward map from numeric inputs and one named explosive to named
outputs, together with what is needed to use it honestly elsewhere: units, the domain of its
training rows, a 95 % error band per output, golden rows to test a copy against, and where it came
from.

The map: each numeric input is logged if its column says so, then standardised; derived columns,
linear combinations of the SI inputs, follow in the same way; the code of the explosive (one-hot,
or any other row of numbers) is appended; dense layers follow; each output is un-standardised and,
if its column says so, exponentiated.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from castblast.errors import SpecError
from castblast.network.faults import network_faults, shell_faults
from castblast.network.parts import Layer, ShellParts
from castblast.network.terms import SCHEMA_VERSION


@dataclass(frozen=True, eq=False, kw_only=True)
class Shell(ShellParts):
    """A shell that can be used: whatever makes its parts unusable is refused.

    Raises
    ------
    SpecError
        All faults at once, a line each.
    """

    def __post_init__(self) -> None:
        faults = self._faults()
        if faults:
            raise SpecError("\n".join(f"network: {fault}" for fault in faults))

    def _faults(self) -> list[str]:
        return shell_faults(self)


@dataclass(frozen=True, eq=False, kw_only=True)
class Network(Shell):
    """Scaled feed-forward surrogate with its units, domain, error band and provenance.

    Attributes
    ----------
    layers : tuple of Layer
        The first takes k + d + c values, the last gives one per output.
    schema_version : int
    members : tuple of chains of Layer
        Other fits of the same spec with the scalings of this one; they give the spread of an
        ensemble, never the value.
    """

    layers: tuple[Layer, ...]
    schema_version: int = SCHEMA_VERSION
    members: tuple[tuple[Layer, ...], ...] = ()

    @classmethod
    def of(cls, shell: Shell, layers: tuple[Layer, ...]) -> Network:
        """Put layers into a shell."""
        around = {entry.name: getattr(shell, entry.name) for entry in fields(Shell)}
        return cls(**around, layers=layers)

    def _faults(self) -> list[str]:
        return network_faults(self, self.layers, self.members, self.schema_version)

    @property
    def parameter_count(self) -> int:
        """Number of weights and biases of the network itself, without members."""
        return sum(layer.weights.size + layer.biases.size for layer in self.layers)
