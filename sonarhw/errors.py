"""Every error this project raises on purpose, and the exit status the command line gives it.

    SonarError
    ├── InputError             what a person handed in is wrong: option, room file, profile, CSV   exit 2
    │   └── NotALog            a file that cannot be read as a log, or is damaged beyond reading   exit 2
    ├── LinkError              the way to the scanner is shut
    │   ├── LinkBusy           somebody else holds the port                                        exit 1
    │   ├── LinkForbidden      this person may not open the port                                   exit 1
    │   └── LinkLost           it was open, went away, and did not come back                       exit 1
    ├── DeviceError            something answers, but not as a scanner should
    │   ├── NoAnswer           a deadline passed                                                   exit 1
    │   ├── DeviceReset        it started anew; the driver greets it again and goes on             exit 1
    │   ├── WrongDevice        another scanner than before answers                                 exit 1
    │   ├── Incompatible       it speaks another protocol version                                  exit 1
    │   ├── LostSteps          its zero mark was not where it should be: angles may be off         exit 1
    │   └── CommandRefused     it said no, with a code and a text                                  exit 1
    ├── NoPlate                calibrate did not hear the plate as it should                   exit 1
    ├── Cancelled              long work was asked to end before it was done                   exit 1
    ├── WorkersLost            processes or a cluster that work on a study ended before it     exit 1
    ├── NoDisplay              of `sonarhw_gui.shell.display`: there is no screen for a window                   exit 1
    ├── LogError               a log cannot be written                                             exit 1
    └── OutputError            another file, or standard output, cannot be written                 exit 1

A message says what was expected, what came, where, and what to do; it fits on one line.
"""


class SonarError(Exception):
    """Root of the tree; `exit_status` is what the command line ends with."""

    exit_status = 1


class InputError(SonarError):
    """What a person handed in is wrong; nothing has been done yet."""

    exit_status = 2


class NotALog(InputError):
    """A file that cannot be read as a log: another kind of file, of a newer format, or damaged beyond reading."""


class LinkError(SonarError):
    """The way to the scanner cannot be opened or used."""


class LinkBusy(LinkError):
    """Another process holds the port."""


class LinkForbidden(LinkError):
    """Whoever runs this may not open the port."""


class LinkLost(LinkError):
    """The link was open, went away, and did not come back."""


class DeviceError(SonarError):
    """Something answers, but not as a scanner should."""


class NoAnswer(DeviceError):
    """The device stayed silent past a deadline."""


class DeviceReset(DeviceError):
    """The device has started anew and forgotten the conversation; the driver begins another one and goes on."""


class WrongDevice(DeviceError):
    """Another scanner answers than the one before: its serial number differs."""


class Incompatible(DeviceError):
    """The device speaks a protocol version this driver does not."""


class LostSteps(DeviceError):
    """The zero mark came out of its place, or not at all: angles since it was last seen in it may be off."""


class CommandRefused(DeviceError):
    """The device answered a command with a refusal; `code` is the protocol's refusal code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class NoPlate(SonarError):
    """What was heard is not a plate by which to calibrate."""


class Cancelled(SonarError):
    """Long work was asked to end before it was done; there is no result."""


class WorkersLost(SonarError):
    """Processes or machines that worked on a study are gone before it is done."""


class LogError(SonarError):
    """A log cannot be written."""


class OutputError(SonarError):
    """A file that is no log, or standard output, cannot be written."""
