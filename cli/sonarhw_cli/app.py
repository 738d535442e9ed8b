"""The `sonarhw` command: the list of its subcommands, and the conversion of errors to exit statuses.

Each subcommand has its own file and imports heavy modules inside its function, so that `--help` stays fast.
"""

import errno
import os
import sys
from typing import Annotated

import typer

from sonarhw.errors import SonarError
from sonarhw_cli.comparison import compare_command as compare
from sonarhw_cli.comparison import fit_command as fit
from sonarhw_cli.comparison import locate_command as locate
from sonarhw_cli.comparison import map_command
from sonarhw_cli.comparison import report_command as report
from sonarhw_cli.comparison import study_command as study
from sonarhw_cli.instrument import bench_commands as bench
from sonarhw_cli.instrument import board_command as board
from sonarhw_cli.instrument import calibrate_command as calibrate
from sonarhw_cli.instrument import fake_command as fake
from sonarhw_cli.instrument import import_command as import_csv
from sonarhw_cli.instrument import info_command as info
from sonarhw_cli.instrument import log_command
from sonarhw_cli.instrument import ports_command as ports
from sonarhw_cli.instrument import replay_command as replay
from sonarhw_cli.instrument import scan_command as scan
from sonarhw_cli.prediction import figures_command as figures
from sonarhw_cli.prediction import paths_command as paths
from sonarhw_cli.prediction import simulate_command as simulate
from sonarhw_cli.window import demo_command as demo
from sonarhw_cli.window import gui_command as gui

# phrases in the messages of the option parser, and their replacements
_REWORDED = (
    ("Value error, ", ""),
    ("Input should be a valid integer, unable to parse string as an integer", "expected a whole number"),
    ("Input should be a valid number, unable to parse string as a number", "expected a number"),
    ("Input should be ", "expected a number "),
)

app = typer.Typer(
    name="sonarhw",
    help="Scan a room with an ultrasonic ranging board, and compare the scan with its prediction.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

app.command("demo")(demo.demo)
app.command("ports")(ports.ports)
app.command("info")(info.info)
app.command("scan")(scan.scan)
app.command("home")(bench.home)
app.command("turn", context_settings={"ignore_unknown_options": True})(bench.turn)  # -90 is an angle
app.command("stop")(bench.stop)
app.command("monitor")(bench.monitor)
app.command("calibrate")(calibrate.calibrate_scanner)
app.command("fake")(fake.fake)
app.command("simulate")(simulate.simulate)
app.command("paths")(paths.paths)
app.command("figures")(figures.figures)
app.command("import")(import_csv.import_csv)
app.command("replay")(replay.replay)
app.add_typer(log_command.app, name="log")
app.command("compare")(compare.compare)
app.command("report")(report.report)
app.command("locate")(locate.locate)
app.command("map")(map_command.map_logs)
app.command("study")(study.study)
app.command("fit")(fit.fit)
app.command("gui")(gui.gui)
app.command("board", hidden=True)(board.board)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"sonarhw {version('sonarhw')}")
        raise typer.Exit


@app.callback()
def sonarhw(
    show_version: Annotated[
        bool, typer.Option("--version", "-v", help="Print the version.", is_eager=True, callback=_show_version)
    ] = False,
) -> None:
    """Scan a room with an ultrasonic ranging board, and compare the scan with its prediction."""


def run(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit status: 0 done, 1 run-time error, 2 bad usage or input, 130 Ctrl-C."""
    try:
        return _status(arguments)
    finally:
        _discard_unwritten()


def _status(arguments: list[str] | None) -> int:
    command = typer.main.get_command(app)
    if "_SONARHW_COMPLETE" in os.environ:  # set by the script that --install-completion writes
        command.main(prog_name="sonarhw")
    try:
        # command.main() is not used: it gives Ctrl-C and a closed pipe other exit statuses
        with command.make_context("sonarhw", sys.argv[1:] if arguments is None else arguments) as context:
            status = command.invoke(context)
        if sys.stdout is not None:  # it is None if the shell closed it
            sys.stdout.flush()
        return status or 0
    except typer.Exit as exit_wanted:
        return exit_wanted.exit_code
    except SonarError as error:
        return _report(str(error), error.exit_status)
    except typer.TyperException as error:
        return _report(_reworded(error.format_message()), error.exit_code)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        return 0
    except OSError as error:
        # an error about a file contains its name; without a name, the full disk is that of standard output
        where = error.filename or ("standard output" if error.errno == errno.ENOSPC else "")
        return _report(f"{where}: {error.strerror or error}".removeprefix(": "), SonarError.exit_status)


def _reworded(message: str) -> str:
    for theirs, ours in _REWORDED:
        message = message.replace(theirs, ours)
    return message


def _report(message: str, status: int) -> int:
    # without a command, the message is the help, which keeps its line breaks
    typer.echo(message if message.startswith("Usage:") else f"sonarhw: {' '.join(message.split())}", err=True)
    return status


def _discard_unwritten() -> None:
    """Discard output that standard output does not accept. Python would flush it at exit, fail, and exit with 120."""
    try:
        if sys.stdout is not None:  # it is None if the shell closed it
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
