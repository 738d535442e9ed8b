"""`sonarhw demo`: scan the demo room with a fake scanner, and show the scan over its prediction."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from sonarhw_cli.console.demo_room import PLACE, demo_room, demo_url
from sonarhw_cli.console.output import atomic_file, made_folder
from sonarhw_cli.window.gui_command import show_demo

RESULT = Path("demo-result")  # folder of the demo's files when there is no display
STEP_DEGREES = 3.0


def demo(
    headless: Annotated[
        Path | None,
        typer.Option(help="Without a window: write scan.mcap, overlay.png and summary.json to DIR.", metavar="DIR"),
    ] = None,
) -> int:
    """Scan the demo room with a fake scanner and show the overlay.

    The overlay is the scan drawn over its prediction. Files of an earlier demo are overwritten. The seed is fixed, so
    each run gives the same result.
    """
    if headless is None and _has_display():
        return show_demo()
    folder = headless or RESULT
    with demo_room() as room_file, made_folder(folder):
        _write_result(room_file, folder)
    return 0


def _has_display() -> bool:
    from sonarhw_gui.shell.display import NoDisplay, check_display

    try:
        check_display()
    except NoDisplay:
        typer.echo("There is no display: the demo runs without a window.")
        return False
    return True


def _write_result(room_file: Path, folder: Path) -> None:
    from sonarhw_cli.comparison.compare_command import compare_log, draw_comparison, summary_lines
    from sonarhw_cli.instrument.scan_command import scan

    log, picture, figures = folder / "scan.mcap", folder / "overlay.png", folder / "summary.json"
    scan(demo_url(room_file, "max"), log, room_file, PLACE, step=STEP_DEGREES, traces=True, force=True)
    comparison = compare_log(log, room_file, PLACE)
    with atomic_file(picture, "--headless") as file:
        draw_comparison(comparison, file)
    with atomic_file(figures, "--headless") as file:
        file.write((json.dumps(asdict(comparison.summary()), indent=2) + "\n").encode())
    for line in summary_lines(comparison.summary()):
        typer.echo(line)
    typer.echo(f"The picture is in {picture}, the scan in {log}, the summary in {figures}.")
