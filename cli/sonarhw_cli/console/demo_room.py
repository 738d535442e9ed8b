"""The room of the demo, which is installed with the product, and the URL of the fake scanner in it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PLACE = "bench"
_SEED = 1


@contextmanager
def demo_room() -> Iterator[Path]:
    """Yield the demo's room file, which is valid while the block lasts."""
    from importlib.resources import as_file, files

    with as_file(files("sonarhw_rooms") / "laboratory.toml") as path:
        yield path


def demo_url(room_file: Path, pace: str = "real") -> str:
    """Return the URL of the fake scanner in the demo room."""
    return f"fake:{room_file}?place={PLACE}&seed={_SEED}&pace={pace}"
