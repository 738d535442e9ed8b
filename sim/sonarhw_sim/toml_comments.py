"""Comments of a TOML text during edits: each stays with the table or the list element that it describes.

tomlkit counts the comment above a table as the end of the table before. So a deleted table would take the comment of
the next one along, and a new key would stand below it.
"""

import re
from collections.abc import Iterator, MutableMapping, Sequence
from typing import Any

import tomlkit
from tomlkit.container import Container
from tomlkit.items import AoT, Array, Comment, Table, Trivia, Whitespace

_TOKENS = re.compile(r""""(?:\\.|[^"\\])*"|'[^']*'|#[^\n]*|[\[\]{},\n]|[^\s\[\]{},#"']+""")
_SPACE = "\0"  # in comments above a table; tomlkit would indent new keys of the table like the first spaces
_OPENING, _CLOSING = "[{", "]}"


def bind_comments(document: tomlkit.TOMLDocument) -> str:
    """Move the comments above each table to its header, for `text_of`; return those after the last table."""
    tables = list(_tables(document))
    tails = [_without_tail(table) for table in tables]
    for table, leading in zip(tables[1:], tails, strict=False):
        table.trivia.indent = leading.replace(" ", _SPACE) + table.trivia.indent
    return tails[-1] if tails else ""


def text_of(document: tomlkit.TOMLDocument, end: str) -> str:
    """Return the text of a changed document; `end`: from `bind_comments`."""
    return tomlkit.dumps(document).replace(_SPACE, " ") + end


def remove_table(document: MutableMapping[str, Any], kind: str, index: int) -> None:
    """Remove an element of a list of tables, with its comment; titles above, after a blank line, go to the next table.

    A list without elements is removed. `document`: after `bind_comments`.
    """
    elements = document[kind]
    if isinstance(elements, AoT) and isinstance(document, Container):
        tables = list(_tables(document))
        at = next(k for k, table in enumerate(tables) if table is elements.body[index])
        title = tables[at].trivia.indent.rpartition("\n\n")[0]
        if "#" in title and at + 1 < len(tables):
            tables[at + 1].trivia.indent = f"{title}\n{tables[at + 1].trivia.indent}"
        elif "#" in title:
            tables[at - 1].value.body.append((None, Comment(Trivia(comment=title, trail="\n"))))
    del elements[index]
    if not elements:
        del document[kind]


def like_array(old: Any, values: Sequence[Any]) -> Any:
    """Return these values as a list that keeps the comments of equal elements of an old one."""
    above, beside = _element_comments(old) if isinstance(old, Array) else ({}, {})
    if not above and not beside:
        return values
    places = {_key(element): k for k, element in enumerate(old)}
    lines = tomlkit.array()
    for value in values:
        place = places.get(_key(value), -1)
        for comment in above.get(place, ()):
            lines.add_line(comment=comment)
        lines.add_line(value, comment=beside.get(place, ""))
    for comment in above.get(len(old), ()):
        lines.add_line(comment=comment)
    lines.add_line(indent="")
    return lines


def _tables(container: Container) -> Iterator[Table]:
    """Yield each table with a header, in order."""
    for _, item in container.body:
        for table in item.body if isinstance(item, AoT) else (item,):
            if isinstance(table, Table):
                if not table.is_super_table():
                    yield table
                yield from _tables(table.value)


def _without_tail(table: Table) -> str:
    """Cut off and return the comments after the last key: from the first blank line on, or all without one."""
    body, start = table.value.body, len(table.value.body)
    while start and body[start - 1][0] is None and isinstance(body[start - 1][1], Comment | Whitespace):
        start -= 1
    blank = next((k for k in range(start, len(body)) if isinstance(body[k][1], Whitespace)), start)
    tail = "".join(item.as_string() for _, item in body[blank:])
    del body[blank:]
    return tail


def _element_comments(array: Array) -> tuple[dict[int, list[str]], dict[int, str]]:
    """Return the comments on lines above elements, and on the lines of elements, by their numbers."""
    above: dict[int, list[str]] = {}
    beside: dict[int, str] = {}
    depth, element, begun = 0, -1, False  # begun: whether the line contains a part of an element
    for token in _TOKENS.findall(array.as_string()):
        if token == "\n":
            begun = False
        elif token.startswith("#"):
            text = token[1:].strip()
            if begun:
                beside[element] = " ".join(filter(None, (beside.get(element), text)))
            else:
                above.setdefault(element + 1, []).append(text)
        elif token != ",":
            element += depth == 1 and token not in _CLOSING
            begun = depth > 0
            depth += (token in _OPENING) - (token in _CLOSING)
    return above, beside


def _key(value: Any) -> Any:
    return value if isinstance(value, str) else tuple(map(float, value))
