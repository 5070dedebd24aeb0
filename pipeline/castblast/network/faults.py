"""Everything that makes a network record unusable, all of it at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import get_args

import numpy as np

from castblast.network.kinds import kind_faults
from castblast.network.parts import Column, DensityScore, Layer, ShellParts
from castblast.network.terms import SCHEMA_VERSION, Activation, Transform


def network_faults(
    shell: ShellParts,
    layers: Sequence[Layer],
    members: Sequence[Sequence[Layer]],
    schema_version: int,
) -> list[str]:
    """Say what is wrong with a network, one line each; empty if nothing is.

    Parameters
    ----------
    shell : ShellParts
    layers, members, schema_version
        As in `castblast.network.record.Network`.
    """
    faults = []
    if kinds := kind_faults(shell):
        return kinds
    if schema_version != SCHEMA_VERSION:
        faults.append(f"schema version {schema_version}, this one reads {SCHEMA_VERSION}")
    if not layers:
        faults.append("needs at least one layer")
    return faults + shell_faults(shell) + _layer_faults(shell, layers, members)


def shell_faults(shell: ShellParts) -> list[str]:
    """Say what is wrong around the layers of a surrogate, one line each."""
    if kinds := kind_faults(shell):
        return kinds  # what else there is cannot be looked at
    faults = []
    if not (shell.inputs and shell.outputs and shell.explosives):
        faults.append("needs at least one input, output and explosive")
    columns: tuple[Column, ...] = shell.inputs + shell.derived + shell.outputs
    names = [column.name for column in columns]
    if len(set(names)) != len(names) or len(set(shell.explosives)) != len(shell.explosives):
        faults.append("a name appears twice")
    faults += _column_faults(columns)
    for entry in shell.inputs:
        least = 0.0 if entry.transform == "log" else -np.inf
        if not least < entry.lower <= entry.upper < np.inf:
            faults.append(f"{entry.name}: domain {entry.lower!r} to {entry.upper!r} is not a range")
    faults += [
        f"{column.name}: the relative error band must lie between 0 and 100"
        for column in shell.outputs
        if not 0.0 <= column.relative_band <= 100.0
    ]
    for rule in shell.constraints:
        faults += _unknown_inputs(f"rule '{rule.label}'", rule.coefficients, shell)
        if not np.isfinite([rule.lower, *rule.coefficients.values()]).all():
            faults.append(f"rule '{rule.label}': its numbers must be finite")
    for column in shell.derived:
        faults += _unknown_inputs(column.name, column.coefficients, shell)
        if not np.isfinite(list(column.coefficients.values())).all():
            faults.append(f"{column.name}: its coefficients must be finite")
    if not _has_codes(shell) or not np.isfinite(shell.codes).all():
        faults.append("one row of codes per explosive is needed, of finite numbers")
    if shell.density is not None:
        faults += _density_faults(shell.density, len(shell.inputs))
    return faults + _golden_faults(shell)


def _column_faults(columns: Iterable[Column]) -> list[str]:
    faults = []
    for column in columns:
        if column.transform not in get_args(Transform):
            faults.append(f"{column.name}: unknown transform '{column.transform}'")
        if not (np.isfinite(column.mean) and np.isfinite(column.scale) and column.scale > 0.0):
            faults.append(f"{column.name}: mean and scale must be finite, scale above 0")
    return faults


def _unknown_inputs(what: str, coefficients: Mapping[str, float], shell: ShellParts) -> list[str]:
    known = shell.input_names
    return [f"{what}: no input '{name}'" for name in coefficients if name not in known]


def _has_codes(shell: ShellParts) -> bool:
    return shell.codes.ndim == 2 and len(shell.codes) == len(shell.explosives)


def _layer_faults(
    shell: ShellParts, layers: Sequence[Layer], members: Sequence[Sequence[Layer]]
) -> list[str]:
    if not _has_codes(shell):
        return []
    width, outputs = shell.width, len(shell.outputs)
    faults = _chain_faults(layers, width, outputs)
    for number, member in enumerate(members, 1):
        faults += [f"member {number}: {line}" for line in _chain_faults(member, width, outputs)]
    return faults


def _chain_faults(layers: Sequence[Layer], width: int, outputs: int) -> list[str]:
    """Faults of a chain of layers that takes `width` values."""
    faults = []
    for number, layer in enumerate(layers, 1):
        if layer.activation not in get_args(Activation):
            faults.append(f"layer {number}: unknown activation '{layer.activation}'")
        if layer.weights.ndim != 2 or layer.weights.shape[0] != width:
            shape = layer.weights.shape
            return [*faults, f"layer {number}: weights {shape} do not take {width} values"]
        width = layer.weights.shape[1]
        if layer.biases.shape != (width,):
            faults.append(f"layer {number}: {layer.biases.shape} biases for {width} nodes")
        if not (np.isfinite(layer.weights).all() and np.isfinite(layer.biases).all()):
            faults.append(f"layer {number}: weights and biases must be finite")
    if width != outputs:
        faults.append(f"the last layer gives {width} values for {outputs} outputs")
    return faults


def _density_faults(density: DensityScore, inputs: int) -> list[str]:
    count = len(density.centres)
    shapes = density.centres.shape, density.whitening.shape, density.offsets.shape
    if count < 1 or shapes != ((count, inputs), (count, inputs, inputs), (count,)):
        return [f"density: centres, whitening, offsets {shapes} do not fit {inputs} inputs"]
    numbers = (density.centres, density.whitening, density.offsets, density.threshold)
    if not all(np.isfinite(entry).all() for entry in numbers) or not density.threshold > 0.0:
        return ["density: numbers must be finite, the threshold above 0"]
    if not 0.0 < density.level <= 1.0:
        return [f"density: level {density.level!r} is not a share"]
    return []


def _golden_faults(shell: ShellParts) -> list[str]:
    rows, golden, faults = len(shell.golden.explosives), shell.golden, []
    if golden.inputs.shape != (rows, len(shell.inputs)) or (
        golden.outputs.shape != (rows, len(shell.outputs))
    ):
        faults.append("golden rows do not have the shape of the inputs and outputs")
    if not (np.isfinite(golden.inputs).all() and np.isfinite(golden.outputs).all()):
        faults.append("golden rows must be finite")
    if not set(golden.explosives) <= set(shell.explosives):
        faults.append("golden rows name an unknown explosive")
    return faults
