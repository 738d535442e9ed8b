"""The `sonarhw` command: the list of its subcommands, and the conversion of errors to exit statuses.

Each subcommand has its own file and imports heavy modules inside its function, so that `--help` stays fast.
"""

import errno
import functools
import logging
import os
import re
import shlex
import sys
import warnings
from collections.abc import Callable
from typing import Annotated, TextIO

import typer
from sonarhw_sim.compilation import watch_compilation

from sonarhw.errors import ExitStatus, SonarError
from sonarhw_cli import calibrate, compare, fit, logs, options, rooms, scan, scanner, simulate, window
from sonarhw_cli.outputs import ClosedOutput, CompilationProgress

app = options.CommandList(
    name="sonarhw",
    help="Scan a room with an ultrasonic ranging board, and compare the scan with its prediction.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

# the headings of the help, each with its commands; rare ones are last
_COMMANDS: dict[str, dict[str, Callable[..., int | None] | typer.Typer]] = {
    "Scan": {
        "demo": window.demo,
        "scan": scan.scan,
        "gui": window.gui,
        "serve": scan.serve,
        "replay": scanner.replay,
        "fake": scanner.fake,
        "ping": scan.ping,
        "monitor": scanner.monitor,
    },
    "Predict": {
        "simulate": simulate.simulate,
        "study": fit.study,
        "paths": simulate.paths,
        "figures": simulate.figures,
    },
    "Compare": {
        "compare": compare.compare,
        "report": compare.report,
        "locate": fit.locate,
        "track": fit.track,
        "fit": fit.fit,
        "map": fit.map_logs,
        "calibrate": calibrate.calibrate,
    },
    "Files": {
        "import": logs.import_scan,
        "log": logs.app,
        "room": rooms.room_app,
        "profile": rooms.profile_app,
    },
    "Scanner set-up": {
        "ports": scanner.ports,
        "doctor": scanner.doctor,
        "info": scanner.info,
        "flash": scanner.flash,
        "wiring": scanner.wiring,
        "home": scanner.home,
        "turn": scanner.turn,
        "stop": scanner.stop,
    },
}
_NEGATIVE = {"turn": {"ignore_unknown_options": True}}  # -90 is an angle

for heading, commands in _COMMANDS.items():
    for name, command in commands.items():
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name, rich_help_panel=heading)
        else:
            app.command(name, rich_help_panel=heading, context_settings=_NEGATIVE.get(name))(command)
app.command("board", hidden=True)(scanner.board)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        options.print_line(f"sonarhw {version('sonarhw')}")
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
    options.choose_verbosity(quiet=quiet, verbose=verbose)


_FIRST_STEPS = """\
Scan a room with an ultrasonic ranging board, and compare the scan with its prediction.

First steps:
  sonarhw demo                                     watch a fake scanner and the prediction of its scan
  sonarhw simulate laboratory --out predicted.png  predict a scan of a room, without a scanner
  sonarhw ports                                    find a scanner at a serial port

sonarhw --help lists all commands, and sonarhw COMMAND --help the options of one."""


def run(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit status, one of `ExitStatus`."""
    if sys.stdout is None:  # the shell closed it
        sys.stdout = ClosedOutput()
    watch_compilation(CompilationProgress())
    # matplotlib reports on its own cache of fonts, which is of no concern to the user
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            warnings.showwarning = _warn
            return _status(arguments)
    finally:
        _discard_unwritten()


def _warn(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning of the library about its arguments as the command prints its own."""
    options.warn(str(message))


# kept: a program may run many command lines, and building the parser takes longer than most of them
_command = functools.cache(typer.main.get_command)


def _status(arguments: list[str] | None) -> int:
    command = _command(app)
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given and re.fullmatch("-v+", given[0]) and given != ["-v"]:
        meant = shlex.join(["sonarhw", "--verbose", *(given[1:] or ["COMMAND"])])
        return _refuse(f"-v: prints the version; did you mean `{meant}`?", ExitStatus.BAD_INPUT)
    if given[:1] in (["-h"], ["--help"]):  # of the command, if one follows
        given = [*given[1:], given[0]]
    if "_SONARHW_COMPLETE" in os.environ:  # set by the script that --install-completion writes
        command.main(prog_name="sonarhw")
    try:
        # command.main() is not used: it gives Ctrl-C and a closed pipe other exit statuses
        with command.make_context("sonarhw", given) as context:
            status = command.invoke(context)
        sys.stdout.flush()
        return status or ExitStatus.DONE
    except typer.Exit as exit_wanted:
        return exit_wanted.exit_code
    except SonarError as error:
        options.print_detail(
            f"this is {type(error).__name__}, exit status {error.exit_status}; see docs/reference/errors.md"
        )
        from sonarhw_cli.hints import command_message

        return _report(command_message(options.with_options(str(error)), given, command), error.exit_status)
    except typer.TyperException as error:
        from sonarhw_cli.hints import parser_message

        return _refuse(parser_message(error, given, command), error.exit_code)
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED
    except BrokenPipeError:
        return ExitStatus.DONE
    except MemoryError:
        return _report("there is not enough free memory; close other programs", ExitStatus.FAILED)
    except OSError as error:
        # an error about a file contains its name; without a name, the full disk is that of standard output
        where = error.filename or ("standard output" if error.errno == errno.ENOSPC else "")
        return _report(f"{where}: {error.strerror or error}".removeprefix(": "), SonarError.exit_status)


def _refuse(message: str, status: int) -> int:
    # without a command, the message is the help
    if not message.startswith("Usage:"):
        return _report(message, status)
    options.print_help(_FIRST_STEPS if message.startswith("Usage: sonarhw [OPTIONS] COMMAND") else message)
    return status


def _report(message: str, status: int) -> int:
    options.print_error(message)
    return status


def _discard_unwritten() -> None:
    """Discard output that standard output does not accept. Python would flush it at exit, fail, and exit with 120."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
