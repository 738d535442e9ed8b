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
    ├── NoDisplay              there is no display for a window (`sonarhw_gui.window.start`)      exit 1
    ├── LogError               a scan cannot be recorded: its log cannot be written                exit 1
    └── OutputError            another file, or standard output, cannot be written                 exit 1

A message states what is wrong, where, what was expected, and what to do. It fits on one line.
"""

import json
import math
import unicodedata
from collections.abc import Iterable, Sequence
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


class InputError(SonarError, ValueError):
    """The input is invalid; nothing has been done yet. It is a ValueError too."""

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


# text of messages; names of files and devices may contain escape sequences, line breaks and direction marks


_ESCAPED = ("Cc", "Cf", "Cs", "Zl", "Zp")  # categories: control, format, surrogate, line and paragraph separator


def harmless(text: str) -> str:
    """Return a text with every control character, direction mark, line break and surrogate as an escape: `\\x1b`."""
    return text if text.isprintable() else "".join(map(_harmless_character, text))


def _harmless_character(character: str) -> str:
    if unicodedata.category(character) in _ESCAPED:
        return character.encode("unicode_escape").decode("ascii")
    return character


def shortened(text: str, most: int) -> str:
    """Return a text of at most `most` characters: of a longer one the begin and the end, with … between them."""
    if len(text) <= most:
        return text
    end = most // 3
    return f"{text[: most - end - 1]}…{text[-end:]}"


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: `1 reading`, `2 readings`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def listed(words: Sequence[str], before_last: str) -> str:
    """Return words as a list in a sentence, such as `m, ft or yd`."""
    *others, last = words or [""]
    return f"{', '.join(others)} {before_last} {last}" if others else last


def counted_are(count: int, noun: str) -> str:
    """Return a count as the begin of a sentence: `1 reading is`, `2 readings are`."""
    return f"{counted(count, noun)} {'is' if count == 1 else 'are'}"


# suggestions for misspelt names: `; did you mean 'center'?`


_ALIKE = 0.7  # similarity from 0 to 1; 'pressure' and 'pressure_kpa' have 0.8
_MOST_LETTERS = 100  # longer words are not compared: the time is quadratic


def near_misses(word: str, words: Iterable[str]) -> list[str]:
    """Return the one or two known names that begin with a word, else the most similar one; none if none is similar."""
    from difflib import get_close_matches  # only for a word that is refused

    names = {name.casefold(): name for name in words}
    longer = [name for key, name in names.items() if key.startswith(word.casefold())] if len(word) > 1 else []
    if len(longer) in (1, 2):
        return longer
    close = get_close_matches(word.casefold(), names, n=1, cutoff=_ALIKE) if len(word) <= _MOST_LETTERS else []
    return [names[key] for key in close]


def did_you_mean(word: str, words: Iterable[str]) -> str:
    """Return `; did you mean 'NAME'?` for the most similar of the known names, or an empty text."""
    near = near_misses(word, words)
    return f"; did you mean {' or '.join(map(repr, near))}?" if near else ""


# cells of CSV


_FORMULA = tuple("=+-@＝＋－＠")  # first characters of a formula; a tab and a line break are escaped


def number(value: float) -> str:
    """Return a number with 9 significant digits, as in every CSV of this project; never `-0`."""
    return f"{value + 0.0:.9g}"


def smaller_unit(length: float, most: float) -> tuple[str, int]:
    """Return the unit that was probably meant for a length in metres, and how many of it are a metre.

    These are centimetres if the length is then at most `most` m, else millimetres.
    """
    return ("centimetres", 100) if abs(length) <= 100 * most else ("millimetres", 1000)


def text_cell(text: str) -> str:
    """Return a name as a CSV cell. No spreadsheet takes it for a formula; control characters are escapes.

    See OWASP, CSV injection: a cell that begins with one of `=+-@` is a formula, and may start a program.
    """
    cell = harmless(text)
    return f"'{cell}" if cell.startswith(_FORMULA) and not _is_number(cell) else cell


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


# headings, estimates and their deviations


_MOST_DECIMALS = 6


def in_degrees(heading: float, decimals: int = 9) -> float:
    """Return a heading (rad) in degrees with this number of decimals, in [0, 360)."""
    # rounded first: a value just below zero would become 360
    return round(math.degrees(heading), decimals) % 360


def heading_text(heading: float, decimals: int = 1) -> str:
    """Return a heading (rad) as text: `270.0°`."""
    return f"{in_degrees(heading, decimals):.{decimals}f}°"


def turned_near(heading: float, around: float = 0.0) -> float:
    """Return the same heading (rad), by full turns, within (-π, π] of `around` (rad).

    An estimate and its interval then read as one: -0.02 ± 0.07, not 359.98 ± 0.07.
    """
    # remainder gives -π for half a turn backwards
    difference = math.remainder(heading - around, math.tau)
    return around + (math.pi if difference <= -math.pi else difference)


def estimate_degrees(heading: float, around: float = 0.0, decimals: int = 9) -> float:
    """Return an estimated heading (rad) in degrees, within (-180, 180] of `around` (rad), never -0."""
    return round(math.degrees(turned_near(heading, around)), decimals) + 0.0


def pose_heading_text(heading: float, around: float = 0.0) -> str:
    """Return the heading (rad) of a pose as text: `-95.0°`, within (-180°, 180°] of `around` (rad)."""
    return f"{estimate_degrees(heading, around, 1):.1f}°"


def estimate_text(value: float, deviation: float) -> str:
    """Return a value with the decimals of two significant digits of its standard deviation, never -0."""
    return f"{value:z.{_decimals(deviation)}f}"


def deviation_text(deviation: float, unit: str) -> str:
    """Return a standard deviation with two significant digits and its unit; metres as millimetres."""
    if unit == "m":
        return deviation_text(deviation * 1000, "mm")
    return with_unit(f"{deviation:.{_decimals(deviation)}f}", unit)


def with_unit(text: str, unit: str) -> str:
    """Return a number with its unit: `1.5 mm`, `90°`, `0.9`."""
    return text + unit if unit in ("", "°") else f"{text} {unit}"


def _decimals(deviation: float) -> int:
    # rounding may need one decimal less: 0.0996 is 0.10
    rounded = float(f"{deviation:.1e}")
    return min(_MOST_DECIMALS, max(0, 1 - math.floor(math.log10(rounded)))) if rounded > 0 else _MOST_DECIMALS


# JSON that every parser accepts


def json_text(figures: object) -> str:
    """Return figures as indented JSON. Infinity and NaN, which JSON does not have, become null."""
    return json.dumps(_finite(figures), indent=2, allow_nan=False)


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
