"""`sonarhw demo`: the main job with no hardware: a fake scanner's scan of the demo room lands on its prediction."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from sonarhw.errors import InputError

PLACE = "bench"
SEED = 1
RESULT = Path("demo-result")  # where the demo leaves its files when it finds no display
STEP_DEGREES = 3.0


def demo(
    headless: Annotated[
        Path | None, typer.Option(help="No window: leave scan.mcap, overlay.png and summary.json here.", metavar="DIR")
    ] = None,
) -> int:
    """Scan the demo room with a fake scanner and see the scan over its prediction.

    Its own files of an earlier run are written anew: the demo is seeded and gives the same again.
    """
    with demo_room() as room_file:
        if headless is None and _has_display():
            return _in_a_window(room_file)
        _without_a_window(room_file, headless or RESULT)
        return 0


@contextmanager
def demo_room() -> Iterator[Path]:
    """The room file of the demo, which ships with the product."""
    from importlib.resources import as_file, files

    with as_file(files("rooms") / "laboratory.toml") as path:
        yield path


def demo_url(room_file: Path, pace: str) -> str:
    """The URL of the demo's fake scanner."""
    return f"fake:{room_file}?place={PLACE}&seed={SEED}&pace={pace}"


def _has_display() -> bool:
    from gui.display import NoDisplay, check_display

    try:
        check_display()
    except NoDisplay:
        typer.echo("No window can be opened here: the demo runs without one.")
        return False
    return True


def _in_a_window(room_file: Path) -> int:
    from cli.gui import gui

    return gui(demo_url(room_file, "real"), room_file, PLACE)


def _without_a_window(room_file: Path, folder: Path) -> None:
    from cli.compare import compare_log, draw_comparison, summary_lines
    from cli.scan import scan

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}; give another folder") from error
    log, picture, figures = folder / "scan.mcap", folder / "overlay.png", folder / "summary.json"
    scan(demo_url(room_file, "max"), log, room_file, PLACE, step=STEP_DEGREES, traces=True, force=True)
    comparison = compare_log(log, room_file, PLACE)
    draw_comparison(comparison, picture)
    figures.write_text(json.dumps(asdict(comparison.summary()), indent=2) + "\n")
    for line in summary_lines(comparison.summary()):
        typer.echo(line)
    typer.echo(f"The picture lies in {picture}, the scan in {log}, the figures in {figures}.")
