"""The page of figures for visitors: `python -m benchmarks.how_good [--scans FOLDER] [ROW ...]`.

Runs the command of each row, takes the figures from its output, and writes them with the date to
`docs/explanation/how_good.md`. Rows that are not named keep their figures and date. All rows together take some hours;
`--scans` is the folder of the real scans, without which their rows cannot be measured.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "explanation" / "how_good.md"
HEAD = """# How good is it?

What a visitor wants to know, each figure with the command that prints it and the day it was measured. `python -m
benchmarks.how_good` writes this page; FOLDER is the folder of the real scans, DIR a new one. Times are processor times
on x86_64 with two cores.

| question | answer | command | measured |
|---|---|---|---|
"""
TAIL = """
The real scans are by other teams, of a known room: [real scans](real_scans.md). Two long benchmarks were last run whole
before later changes: [rooms from four to eight scans](fit_method.md#accuracy-in-random-rooms) on 2026-11-27 (`python -m
benchmarks.room_finding`), [intervals of fits](fit_method.md#accuracy-of-fits) on 2026-11-22 (`python -m
benchmarks.fit`).

Next: [limits of the model](model.md#limits), or [the claims of the paper one by one](../figures/figures.md).
"""


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
        r"^all +(\S+) +(\S+)",
        "{0} of the length of the walls within 1 cm and 1°, {1} invented",
    ),
    Row(
        "tracking",
        "How well is a moving robot tracked?",
        "python -m benchmarks.tracking",
        r"^ray-following +(\S+ \S+).*?^cone +(\S+ \S+).*?^nearest +(\S+ \S+)",
        "median error {0}; with a cone {1}, with the nearest wall {2}",
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
        "live",
        "What does a live scan with traces cost?",
        "python -m benchmarks.live 20",
        r": (\S+) of one core\nmemory +(\S+ MB)",
        "{0} of one core and {1}, at 10 pings a second",
    ),
)


def main() -> None:
    """Measure the named rows, or all, and write the page after each."""
    options = _options()
    lines = _lines_of_page()
    for row in ROWS:
        if row.name in options.rows:
            lines[row.command] = row.line(_output(row.command, options.scans), f"{datetime.now(UTC):%Y-%m-%d}")
            table = [lines[row.command] for row in ROWS if row.command in lines]
            PAGE.write_text(HEAD + "\n".join(table) + "\n" + TAIL, encoding="utf-8")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.how_good", description=__doc__.splitlines()[0])
    names = [row.name for row in ROWS]
    parser.add_argument("rows", nargs="*", choices=names, default=names, metavar="ROW", help=f"of {', '.join(names)}")
    parser.add_argument("--scans", default="", metavar="FOLDER", help="folder of the real scans")
    options = parser.parse_args()
    if not options.scans:
        options.rows = [row.name for row in ROWS if row.name in options.rows and "FOLDER" not in row.command]
    return options


def _lines_of_page() -> dict[str, str]:
    """Return the rows of the present page, by command."""
    lines = PAGE.read_text(encoding="utf-8").splitlines() if PAGE.exists() else []
    return {parts[3].strip().strip("`"): line for line in lines if len(parts := line.split("|")) == 6}


def _output(command: str, scans: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        words = _program(command.replace("FOLDER", scans).replace("DIR", folder).split())
        return subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout


def _program(words: Sequence[str]) -> list[str]:
    """Return the command with the program of this installation."""
    return (
        [sys.executable, *words[1:]]
        if words[0] == "python"
        else [str(Path(sys.executable).with_name(words[0])), *words[1:]]
    )


if __name__ == "__main__":
    main()
