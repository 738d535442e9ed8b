"""The parts of HTML reports: page, tables and pictures. A page contains all its pictures and needs no other file."""

from base64 import b64encode
from collections.abc import Iterable, Iterator, Sequence
from html import escape

from sonarhw.errors import harmless

Facts = Sequence[tuple[str, str]]

_MEDIA = {".svg": "svg+xml", ".png": "png"}
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 68em; margin: 2em auto; padding: 0 1em; }
h1 { margin-bottom: 0; } h2 { margin-top: 1.8em; border-bottom: 1px solid #ccc; }
img { max-width: 100%; } table { border-collapse: collapse; } .facts td:first-child { color: #555; }
td, th { padding: 2px 10px 2px 0; text-align: left; vertical-align: top; }
:is(.readings, .regions) td:nth-child(-n+5), .notes td:nth-child(-n+3), .surfaces :is(td, th):nth-child(n+2) {
  text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.surfaces { margin: 0.8em 0; }
:is(.regions, .notes, .surfaces) th { border-bottom: 1px solid #ccc; }
.readings th { position: sticky; top: 0; background: #fff; border-bottom: 1px solid #ccc; }
pre { background: #f4f4f2; padding: 1em; overflow-x: auto; } .lead { font-size: 1.15em; }
@media print { .readings th { position: static; } }
"""


def html_page(title: str, body: Iterable[str]) -> str:
    """Return a page; `title` is plain text, `body` are lines of HTML."""
    head = f'<head><meta charset="utf-8"><title>{escaped(title)}</title><style>{_STYLE}</style></head>'
    return "\n".join(("<!DOCTYPE html>", '<html lang="en">', head, "<body>", *body, "</body></html>"))


def table_head(kind: str, names: Iterable[str]) -> Iterator[str]:
    """Yield the begin of a table; `kind` is its class, `names` are the heads of its columns."""
    yield f'<table class="{kind}"><thead><tr>'
    yield "".join(f"<th>{name}</th>" for name in names) + "</tr></thead><tbody>"


def table_row(cells: Iterable[str]) -> str:
    """Return a row of a table."""
    return "<tr>" + "".join(f"<td>{escaped(cell)}</td>" for cell in cells) + "</tr>"


def metres(length: float | None) -> str:
    """Return a length (m) as text; empty without one."""
    return "" if length is None else f"{length:.3f}"


def escaped(name: str) -> str:
    """Return a name as HTML. Control characters and the bytes of a file name that is not UTF-8 are escapes."""
    return escape(harmless(name))


def facts_table(facts: Iterable[tuple[str, str]]) -> str:
    """Return a table of names and values."""
    rows = "".join(f"<tr><td>{escaped(name)}</td><td>{escaped(value)}</td></tr>" for name, value in facts)
    return f'<table class="facts">{rows}</table>'


def picture(suffix: str, content: bytes, meaning: str) -> str:
    """Return a picture from a file with this suffix; `meaning` is its text for readers that show none."""
    data = f"data:image/{_MEDIA[suffix]};base64,{b64encode(content).decode('ascii')}"
    return f'<img alt="{escape(meaning)}" src="{data}">'
