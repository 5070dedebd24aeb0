"""What tests of the LAMMPS and LIGGGHTS decks share: a small bench, and how an engine is run."""

from __future__ import annotations

import subprocess
from math import pi
from pathlib import Path

import numpy as np

from castblast.muckpile.balls.contact import ContactLaw
from castblast.muckpile.balls.particles import particles_at_rest
from castblast.muckpile.cast.case import CastCase
from castblast.muckpile.ground.walls import floor, join, plane, slope


def two_blocks(law: ContactLaw, delay, velocity) -> CastCase:
    """240 balls of three radii in two blocks between frictionless mirrors, before a slope."""
    rng = np.random.default_rng(1)
    x, y, z = np.meshgrid(
        np.arange(6) * 0.25 - 1.45,
        np.arange(5) * 0.25 + 0.13,
        np.arange(8) * 0.245 + 0.125,
        indexing="ij",
    )
    position = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    position += rng.uniform(-0.005, 0.005, position.shape)
    radius = rng.choice([0.08, 0.10, 0.12], len(position))
    walls = join(
        floor(),
        plane((0, 0, 0), (0, 1, 0), 0.0),
        plane((0, 1.25, 0), (0, -1, 0), 0.0),
        plane((-1.6, 0, 0), (1, 0, 0)),
        slope(2.0, pi / 6.0),
    )
    balls = particles_at_rest(position, radius, (position[:, 0] < -0.7).astype(int))
    return CastCase(balls, law, walls, np.array(delay), np.array(velocity))


def run_engine(command: str, folder: Path) -> str:
    """Run the deck in `folder` and return the log."""
    done = subprocess.run(
        [command, "-in", "cast.in", "-log", "log.engine"],
        cwd=folder, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-500:]
    return (folder / "log.engine").read_text()
