"""Command lines made from the options that the commands declare, with files that are usual or damaged."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import typer
from sonarhw_cli.app import app
from sonarhw_sim.board.profile import load_board

from tests.soak.fuzz import boundaries, foreign_files, fuzzed_plugin
from tests.soak.fuzz.boundaries import Chance, any_of
from tests.soak.fuzz.damage import damaged_csv, damaged_toml
from tests.soak.fuzz.damaged_logs import damaged_log, log_bytes

ENDLESS = ("fake", "replay", "serve", "monitor", "ping", "board", "info --watch")  # until they are stopped
SLOW = ("locate", "fit", "map", "study", "track")
ROOM = """name = "Room"
[materials.m]
reflectance = 0.9
scatter = 0.1
[air]
temperature_c = 20.0
[[walls]]
name = "boundary"
points = [[0.0, 0.0], [0.928, 0.0], [0.928, 0.742], [0.0, 0.742]]
closed = true
material = "m"
edges = ["bottom", "right", "top", "left"]
[[posts]]
name = "post"
center = [0.3, 0.3]
radius = 0.05
material = "m"
[places.figure9]
position = [0.774, 0.085]
heading_deg = 10.0
"""
# hears less far than the board it is made from, so that a case needs little time
BOARD = load_board("paper").text.replace("max_range = 10.7", "max_range = 1.2").replace('"paper"', '"near"')
STUDY = """name = "Study"
seed = 1
draws = 2
boards = ["paper"]
[[rooms]]
file = "room.toml"
places = ["figure9"]
[headings]
from = 0.0
to = 360.0
step = 90.0
[vary.board]
threshold_db = [-46.0, -40.0]
max_range = { uniform = [1.0, 1.5] }
[vary.options]
max_bounces = 3
"""
CSV = "t,deg,m\n" + "".join(f"{k / 10},{10 * k},{1 + k / 100 if k % 3 else ''}\n" for k in range(12))
_SUFFIXES = {"simulate": ".csv .npz .png .mcap", "paths": ".csv", "log export": ".csv .npz .mcap", "study": " .d"}
# values that are valid and cheap, so that a case takes less than a second
_QUICK = {"step": "45", "samples": "0", "workers": "1", "board": "", "receiver": "first-echo", "reconnect": "0.1"}
# options whose high values are allowed and take long: only these values are given
_EFFORT = {
    "samples": ("0", "-1", "nan", "1_0", ""),
    "step": ("45", "0", "-45", "1e-9", "nan", "inf", "1e400", "400", "1e154", "0x1", ""),
    "sweeps": ("1", "2", "0", "-1", "65536", "1e3", "nan"),
    "pings": ("1", "2", "0", "-1", "256", "65536", "x"),
    "sections": ("1", "0", "-1", "2", "nan", "9223372036854775808"),
    "reconnect": ("0", "-1", "nan", "0.1", "inf", "1e400"),
    "faintest": ("-60", "0", "1", "nan", "inf", "-0", "-40"),
    "max_bounces": ("0", "1", "-1", "5", "1001", "nan"),
    "workers": ("1", "0", "-1", "nan", "1.5"),
    "traces": ("envelope", "sampled", "rf", "x", ""),
    "watch": (),
}


@dataclass
class Case:
    """One command line with its files."""

    arguments: list[str]
    files: dict[str, bytes] = field(default_factory=dict)
    outputs: list[str] = field(default_factory=list)

    @property
    def slow(self) -> bool:
        """Whether the usual work of the command takes long."""
        return self.arguments[0] in SLOW or not {"--find-missing", "--fit"}.isdisjoint(self.arguments)

    @property
    def endless(self) -> bool:
        """Whether the command may run until it is stopped."""
        words = " ".join(self.arguments)
        return any(words.startswith(name) for name in ENDLESS) or "--watch" in words


def leaf_commands(command: Any, *names: str) -> Iterator[tuple[str, Any]]:
    """Yield the name and the definition of every command."""
    for name, part in getattr(command, "commands", {}).items():
        yield from leaf_commands(part, *names, name)
    if not hasattr(command, "commands"):
        yield " ".join(names), command


COMMANDS = dict(leaf_commands(typer.main.get_command(app)))


class Generator:
    """Makes the case of a number: the same number gives the same case."""

    def __init__(self, folder: Path, commands: Sequence[str] = ()) -> None:
        """Prepare the whole files. `folder` is for temporary files; `commands` limits the commands."""
        self._commands = commands or [name for name in COMMANDS for _ in range(1 if name in SLOW else 4)]
        self._folder = folder
        self._board = BOARD
        self._logs = [log_bytes(folder / "whole.part", ROOM, self._board, traces=traces) for traces in (False, True)]
        (folder / "whole.part").unlink()

    def case(self, number: int) -> Case:
        """Return the case of a number."""
        chance = Chance(number)
        name = chance.choice(self._commands)
        case = Case(name.split())
        for parameter in COMMANDS[name].params:
            usual = parameter.required or parameter.name in (*_QUICK, "headless")
            if usual or chance.random() < 2 / len(COMMANDS[name].params):
                case.arguments += self._given(chance, name, parameter, case)
        if chance.hostile(0.05):
            case.arguments.insert(chance.randrange(len(case.arguments) + 1), chance.choice(boundaries.NAMES))
        if chance.random() < 0.1 and case.outputs and case.outputs[0].startswith("out"):  # something of the user's
            case.files[case.outputs[0]] = b"precious"
        case.arguments = [argument.replace("\0", "\1") for argument in case.arguments]  # no system passes a NUL
        return case

    def _given(self, chance: Chance, name: str, parameter: Any, case: Case) -> list[str]:
        option = parameter.opts[0] if parameter.param_type_name == "option" else None
        if getattr(parameter, "is_flag", False):
            return [option]
        count = chance.choice((1, 1, 2)) if parameter.multiple or parameter.nargs == -1 else 1
        values = [self._value(chance, name, parameter, case) for _ in range(count)]
        if option is None:
            return values
        return [part for value in values for part in (option, value)]

    def _value(self, chance: Chance, name: str, parameter: Any, case: Case) -> str:
        what, metavar = parameter.name or "", parameter.metavar or ""
        if what in _EFFORT:
            return any_of(chance, _EFFORT[what], _QUICK.get(what, _EFFORT[what][0]))
        if what in ("out", "plot", "board_out", "folder", "headless"):
            return self._output(chance, name, metavar, case)
        if what == "file" and name in ("import", "room import"):
            return self._foreign(chance, name, case)
        read = {"spec": self._study, "file": self._csv, "sources": self._log, "url": self._url}.get(what)
        if read is None and metavar.startswith("LOG"):
            read = self._log
        if read is None and metavar == "ROOM":
            read = self._room
        if read is not None:
            return read(chance, case)
        if what == "board" and chance.hostile(0.4):
            return any_of(chance, boundaries.NAMES, "paper")
        if what == "board":
            return self._profile(chance, case)
        return _text(chance, name, parameter)

    def _output(self, chance: Chance, name: str, metavar: str, case: Case) -> str:
        suffix = Path(metavar).suffix if "." in metavar else ""
        suffix = suffix or chance.choice(_SUFFIXES.get(name, ".d" if metavar == "DIR" else ".mcap").split(" "))
        usual = f"out{suffix}"
        others = (*boundaries.OUTPUTS, "-", f"missing/x{suffix}", "room.toml", "x.docx")
        # a demo and the figures take minutes
        slow = name in ("demo", "figures")
        given = chance.choice(boundaries.DEVICES) if slow else any_of(chance, others, usual, 0.2)
        case.outputs.append(given)
        return given

    def _room(self, chance: Chance, case: Case) -> str:
        return self._text_file(chance, case, "room.toml", ROOM)

    def _profile(self, chance: Chance, case: Case) -> str:
        return self._text_file(chance, case, "board.toml", self._board)

    def _study(self, chance: Chance, case: Case) -> str:
        case.files.setdefault("room.toml", ROOM.encode())
        return self._text_file(chance, case, "study.toml", STUDY)

    def _text_file(self, chance: Chance, case: Case, name: str, text: str) -> str:
        if chance.hostile(0.08):
            return chance.choice(boundaries.SPECIAL_FILES)
        case.files[name] = damaged_toml(chance, text) if chance.hostile(0.6) else text.encode()
        return name

    def _foreign(self, chance: Chance, name: str, case: Case) -> str:
        if chance.hostile(0.08):
            return chance.choice(boundaries.SPECIAL_FILES)
        whole = foreign_files.scans() if name == "import" else foreign_files.rooms()
        read, files = foreign_files.damaged(chance, whole)
        case.files |= files
        return read

    def _csv(self, chance: Chance, case: Case) -> str:
        if chance.hostile(0.08):
            return chance.choice(boundaries.SPECIAL_FILES)
        case.files["scan.csv"] = damaged_csv(chance, CSV) if chance.random() < 0.8 else CSV.encode()
        return "scan.csv"

    def _log(self, chance: Chance, case: Case) -> str:
        if chance.hostile(0.08):
            return chance.choice(boundaries.SPECIAL_FILES)
        whole = chance.choice(self._logs)
        damaged = chance.random() < 0.7
        content = damaged_log(chance, self._folder, whole, ROOM, self._board) if damaged else whole
        name = chance.choice(("scan.mcap", "other.mcap", os.fsdecode(b"scan\xff.mcap")))
        case.files[name] = content
        return name

    def _url(self, chance: Chance, case: Case) -> str:
        if chance.hostile(0.5):
            return chance.choice(boundaries.URLS)
        kind = chance.random()
        if kind < 0.3:
            return self._log(chance, case)
        if kind < 0.5:
            return f"{chance.choice([*fuzzed_plugin.SCHEMES])}:{chance.randrange(10**6)}"
        if kind < 0.6:
            keys = [*boundaries.LINES, chance.choice([*boundaries.LINES])]
            chosen = chance.sample(keys, chance.randrange(1, 5))
            port = chance.choice(("missing", "loop://", *boundaries.URLS))
            return f"lines:{port}?{'&'.join(f'{key}={chance.choice(boundaries.LINES[key])}' for key in chosen)}"
        keys = {"pace": any_of(chance, boundaries.PACES, "max", 0.1), "board": self._profile(chance, case)}
        for key, values in (
            ("place", boundaries.NAMES),
            ("seed", boundaries.NUMBERS),
            ("board", ("paper", "nothing", "board.toml", "/dev/null")),
            ("faults", boundaries.FAULTS),
            ("\x1b", boundaries.NAMES),
        ):
            if chance.hostile(0.25):
                keys[key] = chance.choice(values)
        return f"fake:{self._room(chance, case)}?{'&'.join(f'{key}={value}' for key, value in keys.items())}"


def _text(chance: Chance, name: str, parameter: Any) -> str:
    metavar, what = parameter.metavar or "", parameter.name or ""
    known = {
        "NAME=...": (boundaries.PRIORS, "heading=0..20"),
        "X,Y,DEG": (boundaries.POSES, "0.774,0.085,0"),
        "HOST:PORT": (boundaries.ADDRESSES, "127.0.0.1:0"),
        "tcp://HOST:PORT": (("tcp://127.0.0.1:1", "", "x", "tcp://", "tcp://\x1b"), "tcp://127.0.0.1:1"),
        "SPEC": (boundaries.FAULTS, "drop=0.01"),
        "real|N|max": (boundaries.PACES, "max"),
        "real|N": (boundaries.PACES, "1"),
        "LINK": (boundaries.SPECIAL_FILES, "link"),
        "COL": (("t", "deg", "m", "", "x", "\x1b", "=1"), {"heading": "deg", "distance": "m"}.get(what, "t")),
    }.get(metavar)
    if what == "time_column":
        known = (("t", "deg", "m", "", "x"), "t")
    if known is not None:
        return any_of(chance, *known, 0.3 if parameter.required else 0.6)
    kind = parameter.type_descriptor.annotation
    choices = [str(one.value) for one in kind] if isinstance(kind, type) and issubclass(kind, Enum) else []
    if choices:
        return any_of(chance, ("", "x", choices[0].upper(), *choices), chance.choice(choices))
    if kind in (int, float):
        return any_of(chance, boundaries.NUMBERS, "1" if parameter.default is None else f"{parameter.default:g}", 0.7)
    return any_of(chance, boundaries.NAMES, parameter.default or "figure9", 0.5)
