"""A short list of recently used names, newest first."""

MOST = 10


def with_newest(names: tuple[str, ...], name: str) -> tuple[str, ...]:
    """The names with one more in front, each once."""
    return (name, *(other for other in names if other != name))[:MOST]
