"""Generate docs/reference/file_formats.md from the models of room files and board profiles.

python docs/site/file_formats.py
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sonarhw_sim.air import EdgeStrength, Receiver
from sonarhw_sim.board.profile import BoardFile
from sonarhw_sim.files import MOST_BYTES, TomlModel, json_schema
from sonarhw_sim.room.room_file import RoomFile

PAGE = Path(__file__).parents[1] / "reference" / "file_formats.md"
Schema = dict[str, Any]
_CHOICES = {choice.__name__: choice for choice in (Receiver, EdgeStrength)}

BEGIN = f"""# Room files and board profiles

Generated from the models by `python docs/site/file_formats.py`. Room files and board profiles are
[TOML](https://toml.io) files in UTF-8 of at most {MOST_BYTES / 2**20:g} MiB. Every number is finite. An unknown key is
an error. [Notes on readings](#notes-file) are described at the end.

`sonarhw room new FILE.toml` and `sonarhw profile new FILE.toml` write an annotated file. `sonarhw room check FILE` and
`sonarhw profile check FILE` check one. How to draw a room: [own rooms](../how_to/rooms.md).

## Names and files

Where a command, a `fake:` URL, a study or `load_room` needs a room, a text that ends in `.toml` or contains a slash is
a file. Any other text is the name of a shipped room: `laboratory` is shipped, `laboratory.toml` and `./laboratory` are
files. In Python a `Path` is always a file. Boards follow the same rule. `sonarhw room list` and `sonarhw profile list`
print the names.

## In an editor

`sonarhw room schema > room.schema.json` and `sonarhw profile schema > profile.schema.json` write a JSON Schema. Editors
with taplo (the extension Even Better TOML of VS Code) use it for completion and errors if the first line of the TOML
file names it:

```toml
#:schema ./room.schema.json
```

The schema has no rules that connect several keys, such as "every material of a wall is defined". The commands check
those too.
"""


NOTES = """## Notes file

Notes on readings are kept beside the log, which is never changed: those of `scan.mcap` in `scan.notes.csv`. The window
writes the file at once when a note is saved, and removes it with the last note. `sonarhw compare` and `sonarhw report`
show the notes, and `sonarhw log export` adds them. Copy and rename both files together.

The file is CSV in UTF-8 with this header, and may be edited:

```text
sweep,reading,heading_deg,range_m,note
1,54,270,0.827,false wall: bottom>top>bottom
```

| column | value | unit | meaning |
|---|---|---|---|
| `sweep` | whole number |  | sweep of the reading, from 1, as in `compare --sweep` |
| `reading` | whole number |  | number of the reading within its scan, from 0, as in the report |
| `heading_deg` | number | degrees | turntable angle of the reading, as in `log export` |
| `range_m` | number | m | range of the reading; empty without an echo |
| `note` | text to 500 characters |  | the note, one line; `'` before a formula keeps it a text |

A note belongs to the reading with this sweep and number, if heading and range agree with it. Otherwise the log has
changed: one line says so, and the note stays in the file. A line that is not a note is kept and not shown. A file
without this header is not changed. If the folder of a log cannot be written, the window keeps the notes in its own
folder, and shows them when it opens the log again.
"""


def page() -> str:
    """Return the whole page."""
    parts = [BEGIN, *_document("Room file", RoomFile), *_document("Board profile", BoardFile), NOTES]
    return "\n".join(parts)


def _document(title: str, model: type[TomlModel]) -> Iterator[str]:
    schema = json_schema(model)
    yield f"## {title}\n"
    yield _table(schema)
    yield from _tables_in(schema, schema["$defs"], "")


def _tables_in(schema: Schema, definitions: Schema, before: str) -> Iterator[str]:
    """Yield the sections of the tables that a table contains; `before` is the beginning of their names."""
    for key, value in schema["properties"].items():
        if name := _reference(value):
            path = _path(before + key, value)
            heading = f"[[{path}]]" if value.get("type") == "array" else f"[{path}]"
            yield f"### `{heading}`\n\n{value['description'][0].upper()}{value['description'][1:]}.\n"
            yield _table(definitions[name])
            yield from _tables_in(definitions[name], definitions, f"{path}.")


def _reference(value: Schema) -> str | None:
    """Return the name of the table that a key contains."""
    inner = [value, value.get("items"), value.get("additionalProperties"), *value.get("anyOf", ())]
    found = [part["$ref"].rsplit("/", 1)[1] for part in inner if isinstance(part, dict) and "$ref" in part]
    return found[0] if found and found[0] not in _CHOICES else None


def _path(key: str, value: Schema) -> str:
    return f"{key}.NAME" if value.get("type") == "object" else key


def _table(schema: Schema) -> str:
    rows = ["| key | value | unit | default | range | meaning |", "|---|---|---|---|---|---|"]
    required = schema.get("required", ())
    for key, value in schema["properties"].items():
        if not _reference(value):
            default = "required" if key in required else _default(value.get("default"))
            cells = (f"`{key}`", _kind(value), value.get("unit", ""), default, _range(value), value["description"])
            rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def _default(value: object) -> str:
    if value is None or value == []:
        return ""
    return f"`{str(value).lower()}`" if isinstance(value, bool) else f"`{value}`"


def _plain(value: Schema) -> Schema:
    """Return the schema of a value without that of a missing one."""
    return next((one for one in value.get("anyOf", ()) if one.get("type") != "null"), value)


def _kind(value: Schema) -> str:
    value = _plain(value)
    if "$ref" in value:
        *others, last = (f"`{choice}`" for choice in _CHOICES[value["$ref"].rsplit("/", 1)[1]])
        return f"{', '.join(others)} or {last}"
    if value["type"] == "array":
        if value.get("maxItems") == 2:
            return "two numbers"
        return f"list of {'pairs' if value['items']['type'] == 'array' else _kind(value['items']) + 's'}"
    return {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false"}[value["type"]]


def _range(value: Schema) -> str:
    value = _plain(value)
    if value.get("type") == "array":
        return _range(value["items"])
    if "maxLength" in value:
        return f"to {value['maxLength']} characters"
    low = f"{value['minimum']:.10g}" if "minimum" in value else ""
    low = f"above {value['exclusiveMinimum']:g}" if "exclusiveMinimum" in value else low
    high = f"{value['maximum']:.10g}" if "maximum" in value else ""
    if low and high:
        return f"{low}, to {high}" if low.startswith("above") else f"{low} to {high}"
    return low or (f"to {high}" if high else "")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
