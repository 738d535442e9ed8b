"""The `sonarhw` command: the list of its subcommands, and the conversion of errors to exit statuses.

Each subcommand has its own file and imports heavy modules inside its function, so that `--help` stays fast.
"""

import errno
import logging
import os
import sys
from typing import Annotated

import typer
from sonarhw_sim.compiled import watch_compilation

from sonarhw.errors import ExitStatus, SonarError
from sonarhw_cli.bringup import doctor_command as doctor
from sonarhw_cli.bringup import flash_command as flash
from sonarhw_cli.bringup import wiring_command as wiring
from sonarhw_cli.comparison import calibrate_command as calibrate
from sonarhw_cli.comparison import compare_command as compare
from sonarhw_cli.comparison import fit_command as fit
from sonarhw_cli.comparison import locate_command as locate
from sonarhw_cli.comparison import map_command
from sonarhw_cli.comparison import report_command as report
from sonarhw_cli.comparison import study_command as study
from sonarhw_cli.console.lines import choose_verbosity, print_detail, print_error, print_help, print_line
from sonarhw_cli.console.output import ClosedOutput
from sonarhw_cli.console.plain_help import CommandList
from sonarhw_cli.console.progress import CompilationProgress
from sonarhw_cli.error_wording import library_message, parser_message
from sonarhw_cli.instrument import bench_commands as bench
from sonarhw_cli.instrument import board_command as board
from sonarhw_cli.instrument import fake_command as fake
from sonarhw_cli.instrument import import_command, log_command
from sonarhw_cli.instrument import info_command as info
from sonarhw_cli.instrument import ping_command as ping
from sonarhw_cli.instrument import ports_command as ports
from sonarhw_cli.instrument import replay_command as replay
from sonarhw_cli.instrument import scan_command as scan
from sonarhw_cli.instrument import serve_command as serve
from sonarhw_cli.prediction import figures_command as figures
from sonarhw_cli.prediction import paths_command as paths
from sonarhw_cli.prediction import profile_command, room_command
from sonarhw_cli.prediction import simulate_command as simulate
from sonarhw_cli.window import demo_command as demo
from sonarhw_cli.window import gui_command as gui

app = CommandList(
    name="sonarhw",
    help="Scan a room with an ultrasonic ranging board, and compare the scan with its prediction.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.command("demo")(demo.demo)
app.command("ports")(ports.ports)
app.command("info")(info.info)
app.command("scan")(scan.scan)
app.command("serve")(serve.serve)
app.command("home")(bench.home)
app.command("turn", context_settings={"ignore_unknown_options": True})(bench.turn)  # -90 is an angle
app.command("stop")(bench.stop)
app.command("monitor")(bench.monitor)
app.command("ping")(ping.ping)
app.command("flash")(flash.flash)
app.command("doctor")(doctor.doctor)
app.command("wiring")(wiring.wiring)
app.command("calibrate")(calibrate.calibrate)
app.command("fake")(fake.fake)
app.command("simulate")(simulate.simulate)
app.command("paths")(paths.paths)
app.command("figures")(figures.figures)
app.command("import")(import_command.import_scan)
app.command("replay")(replay.replay)
app.add_typer(log_command.app, name="log")
app.add_typer(room_command.app, name="room")
app.add_typer(profile_command.app, name="profile")
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

        print_line(f"sonarhw {version('sonarhw')}")
        raise typer.Exit


ShowVersion = Annotated[
    bool, typer.Option("--version", "-v", help="Print the version.", is_eager=True, callback=_show_version)
]
Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="Print no warnings, progress or closing lines; only results and errors."),
]
Verbose = Annotated[
    bool,
    typer.Option("--verbose", help="Also print what is read and chosen, and the class of an error."),
]


@app.callback()
def sonarhw(
    show_version: ShowVersion = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Scan a room with an ultrasonic ranging board, and compare the scan with its prediction."""
    choose_verbosity(quiet=quiet, verbose=verbose)


def run(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit status, one of `ExitStatus`."""
    if sys.stdout is None:  # the shell closed it
        sys.stdout = ClosedOutput()
    watch_compilation(CompilationProgress())
    # matplotlib reports on its own cache of fonts, which is of no concern to the user
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    try:
        return _status(arguments)
    finally:
        _discard_unwritten()


def _status(arguments: list[str] | None) -> int:
    command = typer.main.get_command(app)
    given = sys.argv[1:] if arguments is None else arguments
    if "_SONARHW_COMPLETE" in os.environ:  # set by the script that --install-completion writes
        command.main(prog_name="sonarhw")
    try:
        # command.main() is not used: it gives Ctrl-C and a closed pipe other exit statuses
        with command.make_context("sonarhw", list(given)) as context:
            status = command.invoke(context)
        sys.stdout.flush()
        return status or ExitStatus.DONE
    except typer.Exit as exit_wanted:
        return exit_wanted.exit_code
    except SonarError as error:
        print_detail(f"this is {type(error).__name__}, exit status {error.exit_status}; see docs/reference/errors.md")
        return _report(library_message(error, given), error.exit_status)
    except typer.TyperException as error:
        return _refuse(parser_message(error, given), error.exit_code)
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED
    except BrokenPipeError:
        return ExitStatus.DONE
    except OSError as error:
        # an error about a file contains its name; without a name, the full disk is that of standard output
        where = error.filename or ("standard output" if error.errno == errno.ENOSPC else "")
        return _report(f"{where}: {error.strerror or error}".removeprefix(": "), SonarError.exit_status)


def _refuse(message: str, status: int) -> int:
    # without a command, the message is the help
    if not message.startswith("Usage:"):
        return _report(message, status)
    print_help(message)
    return status


def _report(message: str, status: int) -> int:
    print_error(message)
    return status


def _discard_unwritten() -> None:
    """Discard output that standard output does not accept. Python would flush it at exit, fail, and exit with 120."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
