"""The few pieces that the page is made of."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

_STYLE = Path(__file__).with_name("style.css")


def page(title: str, body: Iterable[str]) -> str:
    """Return a whole page; nothing in it asks the network for anything."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{_STYLE.read_text(encoding='utf-8')}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(body)
        + "\n</main>\n</body>\n</html>\n"
    )


def heading(text: str) -> str:
    """Return the heading of a section."""
    return f"<h2>{escape(text)}</h2>"


def paragraph(text: str, kind: str = "") -> str:
    """Return a paragraph."""
    return f"<p{_class(kind)}>{escape(text)}</p>"


def tiles(items: Iterable[tuple[str, str]]) -> str:
    """Return figures that are to be seen first, each with what it is."""
    boxes = "".join(
        f'<div class="tile"><b>{escape(value)}</b><span>{escape(what)}</span></div>' for value, what in items
    )
    return f'<div class="tiles">{boxes}</div>'


def table(head: Sequence[str], rows: Iterable[Sequence[str]], words: Sequence[int] = ()) -> str:
    """Return a table; the first column and those named in `words` are text, the others numbers."""
    first = "".join(
        f"<th{' style=text-align:left' if i in words else ''}>{escape(cell)}</th>"
        for i, cell in enumerate(head)
    )
    lines = "".join(
        "<tr>"
        + "".join(
            f"<td{_class('words' if i in words else '')}>{escape(cell)}</td>" for i, cell in enumerate(row)
        )
        + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{first}</tr></thead><tbody>{lines}</tbody></table></div>'


def figure(png: bytes, caption: str) -> str:
    """Return a picture, in the page itself."""
    data = base64.b64encode(png).decode("ascii")
    return (
        f'<figure><img src="data:image/png;base64,{data}" alt="{escape(caption, quote=True)}" loading="lazy">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def side_by_side(figures: Iterable[str]) -> str:
    """Return figures in a row, below one another where the screen is narrow."""
    return f'<div class="pair">{"".join(figures)}</div>'


def folded(summary: str, content: str) -> str:
    """Return what opens on a click."""
    return f"<details><summary>{escape(summary)}</summary>{content}</details>"


def listing(text: str) -> str:
    """Return plain text as it stands."""
    return f"<pre>{escape(text)}</pre>"


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""
