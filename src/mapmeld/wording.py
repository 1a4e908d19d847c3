"""Numbers as people read them, the same in tables and in pictures."""

from __future__ import annotations


def rounded(value: float, digits: int) -> str:
    """Return a number in plain digits, never as -0.000."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def probability_text(probability: float | None) -> str:
    """Return a probability with three digits, which never look like certainty where there is none."""
    if probability is None:
        return "-"
    if 0.9995 <= probability < 1:
        return "> 0.999"
    if 0 < probability < 0.0005:
        return "< 0.001"
    return rounded(probability, 3)


def plural(number: int, noun: str) -> str:
    """Return "1 map", "2 maps"."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"
