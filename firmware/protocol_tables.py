"""Generate the sections of the messages in firmware_protocol.md from `sonarhw/wire/messages.py`.

    python firmware/protocol_tables.py

Heading, first paragraph and table of each section are generated; other paragraphs are kept. A new section is inserted
after that of the preceding message.
"""

import re
from dataclasses import fields
from pathlib import Path

from sonarhw.wire.messages import FROM_DEVICE, FROM_HOST, Message

DOCUMENT = Path(__file__).parent.parent / "firmware_protocol.md"


def with_messages(text: str) -> str:
    """Return the document `text` with the sections of all messages."""
    behind = 0
    for kind in FROM_HOST + FROM_DEVICE:
        found = re.search(rf"^### {kind.__name__} · .*?(?=^##|\Z)", text, re.M | re.S)
        old = found[0] if found else ""
        start = found.start() if found else behind
        new = section(kind, old)
        text = text[:start] + new + text[start + len(old) :]
        behind = start + len(new)
    return text


def section(kind: type[Message], old: str) -> str:
    """Return the section of a message, with the other paragraphs of the old section."""
    direction = "host to device" if kind in FROM_HOST else "device to host"
    prose = [
        paragraph
        for paragraph in old.strip("\n").split("\n\n")[2:]
        if not paragraph.startswith("| field ") and paragraph != "No payload."
    ]
    rows = [f"| `{item.name}` | {item.metadata['wire'].name} | {item.metadata['meaning']} |" for item in fields(kind)]
    table = "\n".join(["| field | type | meaning |", "| --- | --- | --- |", *rows]) if rows else "No payload."
    heading = f"### {kind.__name__} · 0x{kind.TYPE:02X} · {direction}"
    return "\n\n".join([heading, str(kind.__doc__), *prose, table]) + "\n\n"


if __name__ == "__main__":
    DOCUMENT.write_text(with_messages(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
