"""The page of figures for visitors: `python -m benchmarks.how_good ROW ... [--scans FOLDER]`.

Runs the command of each named row, takes the figures from its output, and puts the row with the date into the table of
`docs/explanation/how_good.md`. All else on the page stays: other rows keep their figures and their date, and a row that
was never measured is absent. Some commands take hours. `--scans` is the folder of the real scans.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "explanation" / "how_good.md"
TABLE = re.compile(r"(?<=\|---\|---\|---\|---\|\n)(?:\|.*\n)*")


@dataclass(frozen=True)
class Row:
    """A question, the command that answers it, and where the figures are in its output."""

    name: str
    question: str
    command: str  # as it is shown; FOLDER and DIR are replaced when it runs
    pattern: str  # of its output; groups are the figures
    answer: str  # with {0}, {1}, ... for the figures

    def line(self, output: str, day: str) -> str:
        """Return the row of the table. Raises ValueError if the output contains no such figures."""
        figures = re.search(self.pattern, output, re.MULTILINE | re.DOTALL)
        if figures is None:
            raise ValueError(f"{self.command}: expected output with {self.pattern!r}, got {output[-500:]!r}")
        return f"| {self.question} | {self.answer.format(*figures.groups())} | `{self.command}` | {day} |"


ROWS = (
    Row(
        "real",
        "How many echoes of real scans are within 5 cm of the prediction?",
        "python -m benchmarks.real.real_scans FOLDER --models",
        r".*^all +(\S+) \S+ \S+ +(\S+) \S+ \S+ +(\S+) (\S+)",
        "{2}; nearest wall along the axis {0}, nearest wall within ±15° {1} (shares, nine scans)",
    ),
    Row(
        "located",
        "How often is the first pose in a known room right?",
        "python -m benchmarks.real.located_scans FOLDER",
        r"^ *0.00 to 1.00 +(\d+) .*first poses: (\S+) ± (\S+) expected, (\d+) found; Brier score (\S+)",
        "{3} of {0} scans; {1} ± {2} expected from the stated probabilities (Brier score {4})",
    ),
    Row(
        "rooms",
        "How much of an unknown room is found from four to eight scans?",
        "python -m benchmarks.room_finding",
        r"^ +(\d+) .*^ +(\d+) .*^all +(\S+) +(\S+)",
        "{2} of the length of the walls within 1 cm and 1°, {3} invented; random rooms {0} to {1}",
    ),
    Row(
        "tracking",
        "How well is a moving robot tracked?",
        "python -m benchmarks.tracking --whole --sensors 8",
        r"^(\d+) drives of (\S+ m) .*^ray-following +(\S+ m).*^cone +(\S+ m).*^nearest +(\S+ m)",
        "median error {2} in {0} drives of {1}; with a cone {3}, with the nearest wall {4}",
    ),
    Row(
        "figures",
        "How many claims of the paper does the model show?",
        "sonarhw figures DIR",
        r"(\d+) of (\d+) claims hold",
        "{0} of {1}; the others are explained",
    ),
    Row(
        "brute",
        "Do readings agree with an exhaustive search for paths?",
        "python -m benchmarks.brute_force 20",
        r"(\d+) wrong of (\d+) readings",
        "{0} wrong of {1} readings in 20 random rooms",
    ),
    Row(
        "wave",
        "Do levels agree with the exact wave?",
        "python -m benchmarks.wave_equation",
        r"(\d+) cases, (\d+) held; largest differences of these: (\S+) dB, (\S+) dB",
        "within {2} and {3} dB in the {1} of {0} cases that the theory covers",
    ),
    Row(
        "fit",
        "Do the stated intervals of a fit hold the truth?",
        "python -m benchmarks.fit 60",
        r"^all +x .*?coverage +(\S+)",
        "95 % intervals of x hold it in {0}",
    ),
    Row(
        "speed",
        "How long does a prediction take?",
        "python -m benchmarks.speed",
        r"360 headings, 64 walls: ms +- +(\S+).*laboratory, bench: ms +- +(\S+)",
        "360 headings among 64 walls {0} ms; in the laboratory with posts {1} ms",
    ),
    Row(
        "paper",
        "How long does a pose of 16 readings take?",
        "python -m benchmarks.batch",
        r"^arena +hc-sr04 +\S+ ms +(\S+ ms).*?^laboratory +hc-sr04 +\S+ ms +(\S+ ms).*"
        r"paper's algorithm\narena +hc-sr04 +(\S+ ms)\nlaboratory +hc-sr04 +(\S+ ms)$",
        "{0} in the arena, {1} in the laboratory; by the paper's algorithm {2} and {3}",
    ),
    Row(
        "image_sources",
        "How much faster are paths than with pyroomacoustics?",
        "python -m benchmarks.speed",
        r"times pyroomacoustics +≥ \S+ +(\S+).*share of its (\d+) paths found, % +≥ \S+ +(\S+)",
        "{0} times, to seven reflections between 20 walls; {2} % of its {1} paths are found",
    ),
    Row(
        "live",
        "What does a live scan with traces cost?",
        "python -m benchmarks.live 20",
        r": (\S+) of one core\nmemory +(\S+ MB)",
        "{0} of one core and {1}, at 10 pings a second",
    ),
    Row(
        "faults",
        "Do damaged files and command lines crash it?",
        "python -m tests.soak.fuzz 0 20000",
        r"^(\d+) inputs, (\d+) with faults",
        "{1} of {0} inputs give a traceback, a crash, a hang or another fault",
    ),
)


def main() -> None:
    """Measure the named rows, and write the page after each."""
    options = _options()
    for row in ROWS:
        if row.name in options.rows:
            line = row.line(_output(row.command, options.scans), f"{datetime.now(UTC):%Y-%m-%d}")
            PAGE.write_text(with_line(PAGE.read_text(encoding="utf-8"), line), encoding="utf-8")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.how_good", description=__doc__.splitlines()[0])
    names = [row.name for row in ROWS]
    parser.add_argument("rows", nargs="+", choices=names, metavar="ROW", help=f"of {', '.join(names)}")
    parser.add_argument("--scans", default="", metavar="FOLDER", help="folder of the real scans")
    options = parser.parse_args()
    for row in ROWS:
        if row.name in options.rows and "FOLDER" in row.command and not options.scans:
            parser.error(f"{row.name} needs real scans: give their folder with --scans FOLDER")
    return options


def with_line(page: str, line: str) -> str:
    """Return the page with this line in its table, in place of that with the same question, in the order of ROWS."""
    table = TABLE.search(page)
    if table is None:
        raise ValueError(f"{PAGE}: expected a table of four columns, found none")
    lines = {question_of(one): one for one in (*table.group().splitlines(), line)}
    ordered = [lines[row.question] for row in ROWS if row.question in lines]
    return page[: table.start()] + "\n".join(ordered) + "\n" + page[table.end() :]


def question_of(line: str) -> str:
    """Return the question of a line of the table."""
    return line.split("|")[1].strip()


@cache
def _output(command: str, scans: str) -> str:
    """Return what a command prints. Its status is ignored: the fuzz fails if it counts faults, and states how many."""
    with tempfile.TemporaryDirectory() as folder:
        words = _program(command.replace("FOLDER", scans).replace("DIR", folder).split())
        return subprocess.run(words, check=False, stdout=subprocess.PIPE, text=True).stdout


def _program(words: Sequence[str]) -> list[str]:
    """Return the command with the program of this installation."""
    return (
        [sys.executable, *words[1:]]
        if words[0] == "python"
        else [str(Path(sys.executable).with_name(words[0])), *words[1:]]
    )


if __name__ == "__main__":
    main()
