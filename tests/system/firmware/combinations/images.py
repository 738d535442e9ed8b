"""The combinations of controller, ranging and turning that are built, and the interrupt handlers of each."""

import re
import subprocess
from pathlib import Path

from tests.checkout import CHECKOUT

FIRMWARE = CHECKOUT / "firmware"
MEGA, UNO = "mega-polaroid-step-dir", "uno-polaroid-step-dir"
FREE_STACK = 256  # bytes that an Uno never uses
CHIPS = {"mega": "atmega2560", "uno": "atmega328p"}


def combinations() -> list[str]:
    """Return the names of the combinations in the Makefile, such as `uno-hc-sr04-servo`."""
    makefile = (FIRMWARE / "Makefile").read_text().replace("\\\n", "")
    (names,) = re.findall(r"^COMBINATIONS := (.*)$", makefile, re.M)
    return names.replace(":", "-").split()


def sources(combination: str) -> list[Path]:
    """Return the files of the chip, the ranging board and the turntable in a combination, as in the Makefile."""
    traces = "traces" if combination.startswith("mega-polaroid") else "no-traces"
    avr = FIRMWARE / "avr"
    ranging = "hc-sr04" if "-hc-sr04-" in combination else "polaroid"
    turning = combination.split(f"-{ranging}-")[1]
    folders = [avr, avr / CHIPS[combination.split("-")[0]], avr / traces]
    folders += [FIRMWARE / "parts" / ranging, FIRMWARE / "parts" / turning]
    files = [file for folder in folders for file in sorted(folder.glob("*.[ch]"))]
    return [*files, avr / "turning" / "steps.h", avr / "ranging" / f"{ranging}.c", avr / "turning" / f"{turning}.c"]


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
