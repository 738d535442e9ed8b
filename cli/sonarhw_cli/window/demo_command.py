"""`sonarhw demo`: scan the demo room with a fake scanner, and show the scan over its prediction."""

from dataclasses import asdict
from itertools import count
from pathlib import Path
from typing import Annotated

import typer

from sonarhw.errors import InputError, MissingExtra, json_text
from sonarhw.files import atomic_file
from sonarhw_cli.console.demo_room import PLACE, ROOM, demo_url
from sonarhw_cli.console.lines import print_line
from sonarhw_cli.console.options import ForceFiles
from sonarhw_cli.console.output import made_folder, refuse_existing_in
from sonarhw_cli.window.gui_command import show_demo

RESULT = "demo-result"  # folder of the demo's files when there is no display
OPTION = "--headless"
FILES = ("scan.mcap", "overlay.png", "summary.json")
STEP_DEGREES = 3.0


Headless = Annotated[
    Path | None,
    typer.Option(help=f"Without a window: write {FILES[0]}, {FILES[1]} and {FILES[2]} to DIR.", metavar="DIR"),
]


def demo(
    context: typer.Context,
    headless: Headless = None,
    force: ForceFiles = False,
) -> int:
    """Scan the demo room with a fake scanner and show the overlay.

    The overlay is the scan drawn over its prediction. Without a display and without --headless, the files are written
    to a new folder: demo-result, or demo-result-2 and so on. The seed is fixed, so each run gives the same result.
    """
    if force and headless is None:
        raise InputError(f"--force: needs {OPTION} DIR; without it, the demo overwrites nothing")
    if headless is None and _can_open_window():
        return show_demo()
    folder = _free_folder() if headless is None else headless
    refuse_existing_in(folder, [folder / name for name in FILES], force, OPTION)
    with made_folder(folder):
        _write_result(context, folder, force)
    return 0


def _free_folder() -> Path:
    names = (Path(RESULT if number == 1 else f"{RESULT}-{number}") for number in count(1))
    return next(name for name in names if not (name.exists() or name.is_symlink()))


def _can_open_window() -> bool:
    from sonarhw_gui.shell.display import NoDisplay, check_display

    try:
        check_display()
    except NoDisplay:
        print_line("There is no display: the demo runs without a window.")
        return False
    except MissingExtra as error:
        print_line(f"The demo runs without a window: {error}")
        return False
    return True


def _write_result(context: typer.Context, folder: Path, force: bool) -> None:
    from sonarhw_compare.drawings import draw_comparison
    from sonarhw_compare.pictures import write_picture
    from sonarhw_compare.score import score_comparison

    from sonarhw_cli.comparison.compare_command import compare_log, summary_lines
    from sonarhw_cli.instrument.scan_command import scan

    log, picture, figures = (folder / name for name in FILES)
    scan(context, demo_url("max"), log, ROOM, PLACE, step=STEP_DEGREES, traces=True, force=force)
    comparison, _ = compare_log(log, ROOM, PLACE)
    with atomic_file(picture, OPTION, overwrite=force) as file:
        write_picture(draw_comparison(comparison), file, picture.suffix)
    with atomic_file(figures, OPTION, overwrite=force) as file:
        file.write((json_text(asdict(comparison.summary()) | asdict(score_comparison(comparison))) + "\n").encode())
    for line in summary_lines(comparison.summary()):
        print_line(line)
    print_line(f"The picture is in {picture}, the scan in {log}, the summary in {figures}.")
