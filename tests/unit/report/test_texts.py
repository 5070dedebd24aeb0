"""Texts in pictures and reports stand as they are: no formulas of TeX, no HTML."""

from pathlib import Path

from castblast.report.html import Section, Table, write_report
from castblast.report.style import in_style, new_figure, save_figure

ODD = "$\\frac$ a_b^c $x$ 5 $"


@in_style
def test_a_dollar_sign_is_a_dollar_sign(tmp_path: Path) -> None:
    """A folder or a hole may be called so; TeX would refuse it, or drop the signs."""
    figure, axes = new_figure()
    axes.plot([1.0, 2.0], [1.0, 2.0], label=ODD)
    axes.set(title=ODD, xlabel=ODD)
    axes.legend()
    axes.text(1.5, 1.5, ODD)
    path = save_figure(figure, tmp_path / "a.svg")
    assert path.read_text().count("<!-- $\\frac$ a_b^c $x$ 5 $ -->") == 4


@in_style
def test_ticks_of_a_logarithmic_axis_are_plain_numbers(tmp_path: Path) -> None:
    figure, axes = new_figure()
    axes.loglog([1e-3, 1e3], [2.0, 5.0])
    text = save_figure(figure, tmp_path / "a.svg").read_text()
    assert "<!-- 0.001 -->" in text
    assert "<!-- 1000 -->" in text
    assert "$" not in text


def test_a_report_holds_text_only(tmp_path: Path) -> None:
    odd = '<script>alert(1)</script> & "x" \''
    section = Section(odd, paragraphs=[odd], tables=[Table([odd], [[odd]], odd)], points=[odd])
    text = write_report(tmp_path / "r.html", odd, odd, [section]).read_text()
    assert "<script>alert" not in text
    assert text.count("&lt;script&gt;alert(1)&lt;/script&gt;") >= 7
