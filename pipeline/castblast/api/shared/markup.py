"""HTML of a result in a notebook: tables and bars that take the colours of the page around them.

Text and lines have the colour of the page (`currentColor`), so that they are read on light and on
dark ones; bars have colours that stand out on both.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

_CELL = "padding:.15rem .7rem .15rem 0;text-align:left;border:0;color:inherit"
_RULE = "border-bottom:1px solid color-mix(in srgb, currentColor 30%, transparent)"
#: Colours that stay apart for colour-blind readers (Okabe & Ito 2008), without black.
_COLOURS = ("#0072B2", "#56B4E9", "#009E73", "#E69F00", "#CC79A7", "#7F7F7F", "#D55E00")


def box(title: str, *parts: str, lead: str = "") -> str:
    """One result: a title, a line about it, and parts in HTML side by side."""
    inner = "".join(f'<div style="min-width:15rem">{part}</div>' for part in parts)
    below = f'<div style="opacity:.75">{escape(lead)}</div>' if lead else ""
    return (
        '<div style="color:inherit;background:transparent;font-size:.9em">'
        f"<div><strong>{escape(title)}</strong></div>{below}"
        f'<div style="display:flex;flex-wrap:wrap;gap:1.5rem;margin-top:.4rem">{inner}</div></div>'
    )


def table(header: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """A table of texts; the first cell of a row is its heading."""
    title = f'<caption style="text-align:left;opacity:.75">{escape(caption)}</caption>'
    heads = "".join(f'<th scope="col" style="{_CELL};{_RULE}">{escape(t)}</th>' for t in header)
    body = "".join(
        "<tr>"
        + "".join(
            f'<th scope="row" style="{_CELL};font-weight:normal">{escape(cell)}</th>'
            if number == 0
            else f'<td style="{_CELL}">{escape(cell)}</td>'
            for number, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return (
        '<table style="border-collapse:collapse;color:inherit;background:transparent">'
        f"{title if caption else ''}<thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"
    )


def folded(title: str, content: str) -> str:
    """Some HTML that is shown when its title is clicked."""
    return f'<details><summary style="opacity:.75">{escape(title)}</summary>{content}</details>'


def bar(parts: Sequence[tuple[str, float]], caption: str) -> str:
    """Shares of a whole as one bar with a legend; shares of nothing are left out.

    Parameters
    ----------
    parts : sequence of (label, share)
        Shares of 1.
    """
    shown = [(label, share) for label, share in parts if share >= 0.001]
    pieces, legend = "", ""
    for number, (label, share) in enumerate(shown):
        colour = _COLOURS[number % len(_COLOURS)]
        pieces += f'<span style="width:{100 * share:.1f}%;background:{colour}"></span>'
        legend += (
            f'<li style="margin:0"><span style="display:inline-block;width:.7em;height:.7em;'
            f'margin-right:.4em;background:{colour}"></span>{escape(label)} {share:.1%}</li>'
        )
    return (
        f'<div style="opacity:.75">{escape(caption)}</div>'
        f'<div style="display:flex;height:1em;width:15rem">{pieces}</div>'
        f'<ul style="list-style:none;margin:.3rem 0 0;padding:0">{legend}</ul>'
    )
