"""The cast: blocks are thrown at their delays, fly, collide and come to rest as a muckpile.

At its firing time every ball of a block receives the velocity of the block; from then on only
gravity and contacts act. Left out: air drag, the gas that still flows through the rock, and
breakage in flight. The run ends when the translational kinetic energy has stayed below a share of
its maximum for a while after the last firing; spins are not asked, because the contact law does
not stop a ball that spins about its contact normal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import floor, inf, log, nan
from pathlib import Path
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from castblast.errors import Status
from castblast.muckpile.balls.particles import Particles
from castblast.muckpile.cast.case import (
    CastCase,
    CastCounters,
    CastHistory,
    CastResult,
    check_case,
)
from castblast.muckpile.cast.firing import fire_blocks
from castblast.muckpile.cast.ledger import EnergyLedger, close_ledger, mechanical_energy
from castblast.muckpile.cast.restart import INTERVAL, Arrays, Keeper, Kept, case_hash
from castblast.muckpile.engine.simulation import Simulation
from castblast.muckpile.engine.threads import thread_count
from castblast.progress import ProgressCallback, silent
from castblast.stopping import NEVER, StopRequest

__all__ = [
    "CastCase",
    "CastCounters",
    "CastHistory",
    "CastResult",
    "EnergyLedger",
    "SnapshotCallback",
    "check_case",
    "run_cast",
]

#: Called with the simulated time [s] and a copy of the state.
SnapshotCallback: TypeAlias = Callable[[float, Particles], None]


class _Record:
    """Samples of a run and what they say about rest."""

    def __init__(self, case: CastCase) -> None:
        self.case = case
        self.rows: list[tuple[float, ...]] = []
        self.largest_energy = 0.0
        self.largest_overlap = 0.0
        self.deep_share = 0.0
        self.quiet_since = inf
        self.next_sample = case.sample_interval
        self.firings = 0
        self.fired = 0.0
        self.initial = (0.0, 0.0, 0.0)

    def save(self) -> Arrays:
        """Return all of it by name."""
        kept = {name: np.asarray(value) for name, value in vars(self).items() if name != "case"}
        return {f"record.{name}": array for name, array in kept.items()}

    def resume(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `save` returned."""
        for name in vars(self).keys() - {"case"}:
            setattr(self, name, arrays[f"record.{name}"].tolist())
        self.rows = [tuple(row) for row in self.rows]
        self.initial = (self.initial[0], self.initial[1], self.initial[2])

    def add(self, run: Simulation) -> None:
        """Take a sample."""
        balls, contacts = run.survey_balls(), run.survey_contacts()
        moving = balls.translational_energy
        centre = map(float, balls.centre_of_mass)
        self.rows.append((run.clock, moving, balls.rotational_energy, *centre, contacts.contacts))
        self.largest_energy = max(self.largest_energy, moving)
        self.largest_overlap = max(self.largest_overlap, contacts.largest_overlap)
        self.deep_share = max(self.deep_share, contacts.deep_share)
        if moving > self.case.stop_energy_ratio * self.largest_energy:
            self.quiet_since = inf
        elif self.quiet_since == inf:
            self.quiet_since = run.clock

    def at_rest(self, last_firing: float) -> bool:
        """Whether the last sample ends a long enough time of rest."""
        now = self.rows[-1][0]
        since = max(self.quiet_since, last_firing)
        return now >= self.case.min_time and now - since >= self.case.stop_duration

    def share(self, last_firing: float) -> float:
        """Estimate the finished share of the run for people: mostly how far energy has fallen."""
        now, moving = self.rows[-1][0], self.rows[-1][1]
        if now <= last_firing or not 0.0 < moving < self.largest_energy:
            return min(0.1, 0.1 * now / max(last_firing, 1e-9))
        of_time = now / self.case.max_time
        if not 0.0 < self.case.stop_energy_ratio < 1.0:
            return min(0.99, of_time)
        decay = log(self.largest_energy / moving) / -log(self.case.stop_energy_ratio)
        return min(0.99, max(0.1 + 0.89 * decay, of_time))

    def history(self) -> CastHistory:
        """Return the samples as arrays."""
        table = np.array(self.rows, dtype=np.float64)
        return CastHistory(
            time=table[:, 0].copy(),
            translational_energy=table[:, 1].copy(),
            rotational_energy=table[:, 2].copy(),
            centre_of_mass=table[:, 3:6].copy(),
            contacts=table[:, 6].astype(np.int64),
        )


def run_cast(
    case: CastCase,
    progress: ProgressCallback = silent,
    snapshot: SnapshotCallback | None = None,
    restart: Path | None = None,
    restart_interval: float = INTERVAL,
    stop: StopRequest = NEVER,
) -> CastResult:
    """Simulate a cast from the first firing to rest.

    Parameters
    ----------
    case : CastCase
    progress : callable
        Called at every sample.
    snapshot : callable, optional
        Called with the state at the start, every `snapshot_interval` and at the end. It changes
        no number of the result. If it is `Kept`, its own state goes into the restart file.
    restart : path, optional
        File that keeps the state of the run. If it is there, the run goes on from it, to the same
        last bit as without interruption. It is written once more at the end of the run, and is
        the caller's to remove when the result is safe.
    restart_interval : float [s]
        Least wall time between two writings of it.
    stop : StopRequest
        Looked at whenever the state of the run is whole.

    Returns
    -------
    CastResult

    Raises
    ------
    ValueError
        The case contradicts itself; the message names every fault of `check_case`.
    SpecError
        The restart file belongs to another case or cannot be read.
    Stopped
        Somebody asked for it; the restart file is written.
    """
    if faults := check_case(case):
        raise ValueError("; ".join(faults))
    began = perf_counter()
    with thread_count(case.threads):
        run = _make_run(case)
        keeper = Keeper(restart, case_hash(case) if restart else "", restart_interval)
        return _run_to_rest(case, run, keeper, progress, snapshot, stop, began)


def _make_run(case: CastCase) -> Simulation:
    block = case.particles.block
    held = (block >= 0) & case.hold_unfired
    return Simulation(
        case.particles,
        case.law,
        case.walls,
        held,
        gravity=case.gravity,
        step_safety=case.step_safety,
        time_step=case.time_step,
        skin=case.skin,
        ballistic=case.ballistic,
        keep_ledger=case.keep_ledger,
        precision=case.precision,
    )


def _run_to_rest(
    case: CastCase,
    run: Simulation,
    keeper: Keeper,
    progress: ProgressCallback,
    snapshot: SnapshotCallback | None,
    stop: StopRequest,
    began: float,
) -> CastResult:
    record = _Record(case)
    firings = np.unique(case.block_delay[case.block_delay < case.max_time])
    last_firing = float(firings[-1]) if len(firings) else 0.0
    status = Status.NOT_CONVERGED
    parts: list[Kept] = [run, record, *([snapshot] if isinstance(snapshot, Kept) else [])]
    if (kept := keeper.read()) is not None:
        for part in parts:
            part.resume(kept)
    else:
        record.add(run)
        record.initial = mechanical_energy(run, case.gravity)
        if snapshot:
            snapshot(0.0, run.state())
    next_picture = inf
    if case.snapshot_interval > 0.0:
        next_picture = case.snapshot_interval * (1.0 + floor(run.clock / case.snapshot_interval))
    firings = firings[record.firings :]
    if not len(firings) and kept is not None and record.at_rest(last_firing):
        status = Status.OK
    while status == Status.NOT_CONVERGED and run.clock < case.max_time:
        if stop.made:
            keeper.write(_state_of(parts))
            stop.obey(f"stopped at t = {run.clock:.2f} s of the cast; {keeper.how_to_go_on}")
        if len(firings) and run.clock >= firings[0]:
            record.fired += fire_blocks(case, run, float(firings[0]))
            record.firings += 1
            firings = firings[1:]
        event = min(float(firings[0]), case.max_time) if len(firings) else case.max_time
        look = min(record.next_sample, next_picture)
        if run.clock < event and not run.run(look, event, stop):
            status = Status.UNSTABLE_STEP
            break
        if run.clock >= record.next_sample:
            record.add(run)
            if run.failed:
                status = Status.UNSTABLE_STEP
                break
            record.next_sample += case.sample_interval
            fault = keeper.keep(_state_of(parts)) if keeper.due else ""
            progress(record.share(last_firing), fault or _line(record))
            if not len(firings) and record.at_rest(last_firing):
                status = Status.OK
        if run.clock >= next_picture and status != Status.OK:
            next_picture += case.snapshot_interval
            if snapshot:
                snapshot(run.clock, run.state())
    state = run.state()
    if snapshot and status != Status.UNSTABLE_STEP:
        snapshot(run.clock, state)
    if status != Status.UNSTABLE_STEP:
        keeper.keep(_state_of(parts))
    progress(1.0, _line(record))
    return CastResult(
        particles=state,
        time=run.clock,
        status=status,
        failed_ball=run.failed_ball,
        failed_time=run.clock if run.failed else nan,
        history=record.history(),
        ledger=close_ledger(
            run, case.gravity, record.initial, record.fired, recorded=case.keep_ledger
        ),
        counters=CastCounters(
            steps=run.steps,
            rebuilds=run.rebuilds,
            particle_steps=run.steps * len(state.radius),
            smallest_step=run.smallest_step,
            largest_step=run.largest_step,
            largest_overlap=record.largest_overlap,
            deep_share=record.deep_share,
            seconds=perf_counter() - began,
        ),
    )


def _state_of(parts: list[Kept]) -> Arrays:
    """All that a restart file holds."""
    return {name: array for part in parts for name, array in part.save().items()}


def _line(record: _Record) -> str:
    now, moving = record.rows[-1][0], record.rows[-1][1]
    ratio = moving / record.largest_energy if record.largest_energy > 0.0 else 0.0
    return f"t = {now:.2f} s, kinetic energy {100.0 * ratio:.3g} % of its maximum"
