"""The room of the demo, which ships with the product, and the fake scanner in it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PLACE = "bench"
_SEED = 1


@contextmanager
def demo_room() -> Iterator[Path]:
    """The demo's room file, for as long as the block lasts."""
    from importlib.resources import as_file, files

    with as_file(files("sonarhw_rooms") / "laboratory.toml") as path:
        yield path


def demo_url(room_file: Path, pace: str = "real") -> str:
    """The URL of the fake scanner in the demo room."""
    return f"fake:{room_file}?place={PLACE}&seed={_SEED}&pace={pace}"
