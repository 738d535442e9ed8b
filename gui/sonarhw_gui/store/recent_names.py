"""What was used last: files and scanners, the newest first.

Takes names; hands on a tuple of a few.
"""

MOST = 10


def with_newest(names: tuple[str, ...], name: str) -> tuple[str, ...]:
    """The names with one more in front, each once."""
    return (name, *(other for other in names if other != name))[:MOST]
