"""The errors of this project, and the exit status of the command line for each.

    SonarError
    ├── InputError             invalid input: option, room file, board profile, CSV                exit 2
    │   └── NotALog            a file is not a log, or is too damaged to read                      exit 2
    ├── LinkError              the link to the scanner cannot be opened or used                    exit 1
    │   ├── LinkBusy           another program uses the port                                       exit 1
    │   ├── LinkForbidden      no permission to open the port                                      exit 1
    │   └── LinkLost           the link was open, was lost, and did not come back                  exit 1
    ├── DeviceError            the device does not behave as a scanner should                      exit 1
    │   ├── NoAnswer           no answer before the deadline                                       exit 1
    │   ├── DeviceReset        the device restarted; the session greets it again                   exit 1
    │   ├── WrongDevice        another scanner than before answers                                 exit 1
    │   ├── Incompatible       the device uses another protocol version                            exit 1
    │   ├── LostSteps          the zero mark is misplaced or missing: angles may be wrong          exit 1
    │   └── CommandRefused     the device refused a command, with a code and a text                exit 1
    ├── NoPlate                the readings for `calibrate` show no suitable plate                 exit 1
    ├── Cancelled              long work was cancelled before it had finished                      exit 1
    ├── WorkersLost            processes or a cluster ended before their work had finished         exit 1
    ├── MissingExtra           the window or studies are not installed                             exit 1
    ├── NoDisplay              there is no display for a window (`sonarhw_gui.shell.display`)      exit 1
    ├── LogError               a scan cannot be recorded: its log cannot be written                exit 1
    └── OutputError            another file, or standard output, cannot be written                 exit 1

A message states what is wrong, where, what was expected, and what to do. It fits on one line.
"""

from enum import IntEnum


class ExitStatus(IntEnum):
    """The exit statuses of the command line."""

    DONE = 0  # the command has done what was asked, or has printed help or its version
    FAILED = 1  # it started and failed: link, device, disk
    BAD_INPUT = 2  # options or input files are invalid; nothing was done
    INTERRUPTED = 130  # Ctrl-C, SIGTERM or SIGHUP ended it; what was recorded is kept


class SonarError(Exception):
    """Base class of all errors. `exit_status` is the exit status of the command line."""

    exit_status = ExitStatus.FAILED


class InputError(SonarError):
    """The input is invalid; nothing has been done yet."""

    exit_status = ExitStatus.BAD_INPUT


class NotALog(InputError):
    """A file cannot be read as a log: it has another or a newer format, or is too damaged."""


class LinkError(SonarError):
    """The link to the scanner cannot be opened or used."""


class LinkBusy(LinkError):
    """Another process uses the port."""


class LinkForbidden(LinkError):
    """The user has no permission to open the port."""


class LinkLost(LinkError):
    """The link was open, was lost, and did not come back."""


class DeviceError(SonarError):
    """The device does not behave as a scanner should."""


class NoAnswer(DeviceError):
    """The device did not answer before a deadline."""


class DeviceReset(DeviceError):
    """The device has restarted and lost the conversation. The session starts a new one and continues."""


class WrongDevice(DeviceError):
    """Another scanner than before answers: its serial number differs."""


class Incompatible(DeviceError):
    """The device uses a protocol version that this driver does not support."""


class LostSteps(DeviceError):
    """The zero mark is misplaced or missing. Angles since its last correct detection may be wrong."""


class CommandRefused(DeviceError):
    """The device refused a command. `code` is the refusal code of the protocol."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class NoPlate(SonarError):
    """The readings show no plate that is suitable for calibration."""


class MissingExtra(SonarError):
    """A part of the product is missing, because it was installed without an extra, such as `gui`."""

    def __init__(self, need: str, extra: str) -> None:
        install = f"run pip install '.[{extra}]' in the source folder of sonarhw"
        super().__init__(f"{need}, which is not installed: {install}")


class Cancelled(SonarError):
    """Long work was cancelled before it had finished. There is no result."""


class WorkersLost(SonarError):
    """Processes or a cluster ended before their work had finished."""


class LogError(SonarError):
    """A scan cannot be recorded, because its log cannot be written."""


class OutputError(SonarError):
    """A file other than the log of a running scan, or standard output, cannot be written."""
