"""The demo at a tiny size: every step runs, the report stands alone, a second run reuses."""

import re
from pathlib import Path

from castblast.progress import silent
from castblast.stages.demo.run import STEPS, make_demo, summarise

RECIPE = """
name: tiny
version: 1.0.0
title: Tiny recipe of the demo test
summary: A few rows.
size: 220
seed: 5
explosives: [anfo, heavy_anfo]
variables:
  ucs: {lower: 50 MPa, upper: 200 MPa, distribution: log_uniform}
  young_modulus: {lower: 15 GPa, upper: 50 GPa, distribution: log_uniform}
  hole_diameter: {lower: 80 mm, upper: 200 mm}
  bench_height: {lower: 8 m, upper: 15 m}
  burden: {lower: 2 m, upper: 5 m}
  charge_length: {lower: 0.3, upper: 0.9, ratio_of: bench_height}
  spacing: {value: 1, ratio_of: burden}
split: {train: 0.5, valid: 0.1, calibration: 0.2, test: 0.2}
"""

BENCH = """
name: tiny
bench: {length: 6 m, width: 6 m, height: 4 m, burden: 3 m, spacing: 3 m}
firing: {pattern: echelon, delay: 30 ms}
velocity: 8 m/s
balls: {count: 150}
"""


def test_demo(tmp_path: Path) -> None:
    recipe, bench = tmp_path / "recipe.yaml", tmp_path / "bench.yaml"
    recipe.write_text(RECIPE)
    bench.write_text(BENCH)
    demo = make_demo(tmp_path / "demo", recipe=recipe, bench=bench)
    first = {step.title: step.run(demo, silent) for step in STEPS}
    report = (demo.out / "report.html").read_text(encoding="utf-8")
    assert "What is left out" in report
    assert not re.findall(r'(?:src|href)="(?!data:|#)', report), "the report must stand alone"
    page = (demo.out / "export" / "index.html").read_text(encoding="utf-8")
    assert '"format":"castblast history modes"' in page
    assert summarise(demo)["prediction"]["simulated"]["burden_velocity"] > 0
    second = {step.title: step.run(demo, silent) for step in STEPS}
    for title in ("surrogate", "prediction against physics", "muckpile"):
        assert first[title] != second[title]
        assert "reused" in second[title][0]
    assert "finished already" in second["dataset"][0]
