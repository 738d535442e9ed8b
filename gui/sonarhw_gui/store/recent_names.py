"""A short list of recently used names, newest first."""

MOST = 10


def with_newest(names: tuple[str, ...], name: str) -> tuple[str, ...]:
    """Return the names with `name` in front, without duplicates."""
    return (name, *(other for other in names if other != name))[:MOST]
