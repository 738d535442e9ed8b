"""The combinations of controller, ranging and turning that are built, and the interrupt handlers of each."""

import re
import subprocess
from pathlib import Path

from tests.checkout import CHECKOUT

FIRMWARE = CHECKOUT / "firmware"
MEGA, UNO = "mega-polaroid-step-dir", "uno-polaroid-step-dir"
FREE_STACK = 256  # bytes that an Uno never uses
CHIPS = {"mega": "atmega2560", "uno": "atmega328p"}


def combinations(variable: str = "COMBINATIONS") -> list[str]:
    """Return the names of the combinations in the Makefile, such as `uno-hc-sr04-servo`, or those of its PROGRAMS."""
    makefile = (FIRMWARE / "Makefile").read_text().replace("\\\n", "")
    (names,) = re.findall(rf"^{variable} := (.*)$", makefile, re.M)
    return names.replace(":", "-").split()


def sources(combination: str) -> list[Path]:
    """Return the files of the chip, the ranging board and the turntable in a combination, as in the Makefile."""
    controller = combination.split("-")[0]
    ranging = "hc-sr04" if "-hc-sr04-" in combination else "polaroid"
    turning = combination.split(f"-{ranging}-")[1]
    traces = "traces" if combination.startswith("mega-polaroid") else "no-traces"
    board = FIRMWARE / ("avr" if controller in CHIPS else controller)
    folders = [board, board / CHIPS.get(controller, "."), board / traces]
    folders += [FIRMWARE / "parts" / part for part in (ranging, turning, traces)]
    folders += [] if controller in CHIPS else [FIRMWARE / "one-memory"]
    files = {file for folder in folders for file in folder.glob("*.[ch]")}
    files |= {*board.glob("turning/steps.[ch]"), board / "ranging" / f"{ranging}.c", board / "turning" / f"{turning}.c"}
    return sorted(files)


def budgets(combination: str) -> dict[tuple[str, str], int]:
    """Return the budget in cycles of each interrupt handler, by its name and its file."""
    found = {}
    for file in sources(combination):
        for comment, name in re.findall(r"((?://.*\n)*)ISR\((\w+)\)", file.read_text()):
            (found[name, file.name],) = (int(cycles) for cycles in re.findall(r"Budget (\d+) cycles", comment))
    return found


def vector(combination: str, handler: str) -> int:
    """Return the number of the interrupt of a handler."""
    chip = CHIPS[combination.split("-")[0]]
    text = f'#include "chip_facts.h"\n#include "pins.h"\n{handler}\n'
    folders = [f"-I{FIRMWARE / 'avr'}", f"-I{FIRMWARE / 'avr' / chip}"]
    command = ["avr-gcc", f"-mmcu={chip}", *folders, "-E", "-P", "-x", "c", "-"]
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    return int(done.stdout.split()[-1].removeprefix("__vector_"))
