"""What a thing may be called: one pattern for names, one for labels, one for printing any text.

A *name* becomes a file, a folder or a part of an identifier: recipes, datasets, benches, models.
A *label* is for people and stays text: the name of an explosive, the words of a rule. Neither can
hold quotation marks, brackets, backslashes or control characters, or begin with ``= + - @``, so
that no name means anything to a shell, a spreadsheet, a compiler, HTML or the terminal. Writers
escape all the same: a second line of defence.
"""

from __future__ import annotations

import re

#: ASCII only: what a name makes must be the same on every file system.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_LABEL = re.compile(r"[^\W_][\w .,:+/()%#-]{0,119}")
_UNIT = re.compile(r"[A-Za-z0-9%./^()\u00b0\u00b5 -]{1,32}")
#: One part of a unit in UDUNITS spelling: a symbol, and its power where it is negative.
_POWER = re.compile(r"(?P<symbol>[A-Za-zµ°%]+|[A-Za-zµ]+[0-9]+)(?:-(?P<below>[0-9]+))?")
_VARIABLE = re.compile(r"[a-z][a-z0-9_]{0,63}")
#: Devices of Windows, whatever their suffix.
_DEVICE = re.compile(r"(?:con|prn|aux|nul|com\d|lpt\d)(?:\..*)?", re.IGNORECASE)
_LONGEST = 60


def check_name(name: str) -> str:
    """Return a name that can be a file or a folder, as it is.

    Raises
    ------
    ValueError
        It cannot; the message says what is allowed, without the name itself.
    """
    if not _NAME.fullmatch(name) or name.endswith("."):
        message = "up to 64 letters, digits, '-', '_' and '.' are allowed, a letter or digit first"
        raise ValueError(message)
    if _DEVICE.fullmatch(name):
        message = "is the name of a device on Windows; take another"
        raise ValueError(message)
    return name


def check_label(text: str) -> str:
    """Return a name for people, as it is.

    Raises
    ------
    ValueError
        It holds what is not allowed; the message says what is, without the text itself.
    """
    if not _LABEL.fullmatch(text) or text != text.strip():
        message = (
            "up to 120 letters, digits, spaces and _ - . , : + / ( ) % # are allowed, "
            "a letter or digit first"
        )
        raise ValueError(message)
    return text


def each_once(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names as they are; a ValueError says which are given twice."""
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        message = f"given twice: {', '.join(twice)}"
        raise ValueError(message)
    return names


def as_words(name: str) -> str:
    """Name of a variable as words."""
    return name.replace("_", " ")


def is_label(text: object) -> bool:
    """Say whether a text is a label in ASCII, the form in which it can leave for other programs."""
    return isinstance(text, str) and text.isascii() and _LABEL.fullmatch(text) is not None


def is_unit(text: object) -> bool:
    """Say whether a text has the form of a unit: ``kg m-3``."""
    return isinstance(text, str) and _UNIT.fullmatch(text) is not None


def people_unit(unit: str) -> str:
    """Unit as people write it, from its UDUNITS spelling: ``m s-1`` is ``m/s``; parsed alike."""
    parts = [_POWER.fullmatch(part) for part in unit.split()]
    over = " ".join(part[0] for part in parts if part and not part["below"])
    below = [p["symbol"] + p["below"].removeprefix("1") for p in parts if p and p["below"]]
    if not all(parts) or not below:
        return unit
    return f"{over or '1'}/{below[0] if len(below) == 1 else '(' + ' '.join(below) + ')'}"


def is_variable(text: object) -> bool:
    """Say whether a text has the form of the name of a variable: ``burden_velocity``."""
    return isinstance(text, str) and _VARIABLE.fullmatch(text) is not None


def cell_text(text: str) -> str:
    """Text as the content of a cell of a table: a spreadsheet must not take it for a formula.

    A text that begins with ``= + - @``, a tab or a line end gets an apostrophe in front, which
    spreadsheets do not show.
    """
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r", "\n")) else text


def printable(text: str) -> str:
    """Text of unknown origin for one line of a terminal or a message.

    Control characters (an escape sequence could rewrite the screen) are shown as their code.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else repr(c)[1:-1] for c in text)


def shortened(value: object, longest: int = _LONGEST) -> str:
    """Any value as a short printable text for a message, however large it is."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**longest:
        # Python refuses to write out integers of thousands of digits.
        return f"an integer of about {int(value.bit_length() * 0.30103)} digits"
    if isinstance(value, str | bytes | list | tuple | dict) and len(value) > 1000:
        value = value[:1000] if isinstance(value, str | bytes) else f"{len(value)} entries"
    try:
        text = printable(str(value))
    except (ValueError, RecursionError):
        return f"a {type(value).__name__} that cannot be shown"
    return text if len(text) <= longest else text[: longest - 3] + "..."
