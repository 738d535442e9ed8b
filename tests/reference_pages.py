"""Tables of the pages in docs/reference, for tests that compare them with the program."""

import re

from tests.checkout import CHECKOUT

REFERENCE = CHECKOUT / "docs" / "reference"


def section(page: str, heading: str) -> str:
    """Return the text after a heading, up to the next heading."""
    text = (REFERENCE / page).read_text(encoding="utf-8")
    return re.split(r"\n#+ ", text.split(f"\n{heading}", 1)[1])[0]


def keys_in_reference(heading: str) -> set[str]:
    """Return the keys in the first column of the table after a heading of the page on the command line."""
    rows = re.findall(r"^\| (`.*?) \|", section("command_line.md", heading), flags=re.MULTILINE)
    return {key for row in rows for key in re.findall(r"`(\w+)`", row)}
