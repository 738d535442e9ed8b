"""Write the C that must agree with another source: messages with `sonarhw/wire/messages.py`, tables with formulas.

    python firmware/generate.py            writes core/messages.h, core/messages.c and core/tables.c anew
    python firmware/generate.py --check    says which of them differ, and ends with 1 where one does

The results are kept beside the sources, so that whoever builds the firmware needs no Python.
"""

import math
import re
import sys
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Any

from sonarhw.wire import limits, messages, units
from sonarhw.wire.fields import Numbers, Samples, Scalar, Text
from sonarhw.wire.messages import FROM_DEVICE, FROM_HOST, Message

CORE = Path(__file__).parent / "core"
BORN = "/* Written by generate.py; change that, not this. */\n"
CTYPE = {"u8": "uint8_t", "u16": "uint16_t", "u32": "uint32_t", "u64": "uint64_t", "i16": "int16_t", "i32": "int32_t"}

RAMP_STEPS = 1024
THERMISTOR_BETA = 3950.0  # K; of the common 10 kOhm sensors
THERMISTOR_POINTS = 33  # from 0 to full scale
KELVIN = 273.15


def snake(name: str) -> str:
    """`StartScan` as C writes it: start_scan."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def enumerations() -> list[type[IntEnum] | type[IntFlag]]:
    """The codes that messages carry, in the order they are defined."""
    found = [item for item in vars(messages).values() if isinstance(item, type) and issubclass(item, IntEnum | IntFlag)]
    return [item for item in found if item not in (IntEnum, IntFlag)]


def constants() -> dict[str, int]:
    """The numbers that the protocol fixes; times in µs."""
    found = {"NO_TEMPERATURE": units.NO_TEMPERATURE}
    for name, value in vars(limits).items():
        if name.isupper():
            found |= {f"{name}_US": round(value * 1e6)} if isinstance(value, float) else {name: value}
    return found


def header() -> str:
    """messages.h."""
    lines = [BORN, "#ifndef MESSAGES_H", "#define MESSAGES_H\n", '#include "fields.h" // struct payload', ""]
    lines += [f"#define {name} {value}{'u' * (value > 0x7FFFFFFF)}" for name, value in constants().items()] + [""]
    lines.append("enum message_type {")
    lines += [f"    {snake(kind.__name__).upper()} = 0x{kind.TYPE:02x}," for kind in FROM_HOST + FROM_DEVICE] + ["};\n"]
    for codes in enumerations():
        name = snake(codes.__name__)
        lines.append(f"enum {name} {{")
        lines += [f"    {name.upper()}_{code.name} = {code.value}," for code in codes] + ["};\n"]
    for kind in FROM_HOST + FROM_DEVICE:
        lines += structure(kind)
    lines += [f"bool {snake(kind.__name__)}_unpack(struct {snake(kind.__name__)} *to, struct payload *from);"
              for kind in FROM_HOST if fields(kind)]  # fmt: skip
    lines += [""]
    lines += [f"void {snake(kind.__name__)}_pack(struct payload *to, const struct {snake(kind.__name__)} *from);"
              for kind in FROM_DEVICE]  # fmt: skip
    return "\n".join([*lines, "\n#endif", ""])


def structure(kind: type[Message]) -> Iterator[str]:
    """The struct of a message; none for one without payload."""
    if not fields(kind):
        return
    yield f"struct {snake(kind.__name__)} {{"
    for item in fields(kind):
        wire = item.metadata["wire"]
        match wire:
            case Scalar():
                declared = f"{CTYPE[wire.name]} {item.name}"
            case Text():
                declared = f"struct text {item.name}"
            case Numbers():
                declared = f"struct numbers {item.name}"
            case Samples():
                declared = f"struct samples {item.name}"
        yield f"    {declared}; // {item.metadata['meaning']}"
    yield "};\n"


def field_name(wire: Scalar | Text | Numbers | Samples) -> str:
    """Which pair of functions in fields.c reads or writes it."""
    return wire.name if isinstance(wire, Scalar) else type(wire).__name__.lower()


def taken(item: "Field[Any]") -> str:
    """The expression that takes a field out of a payload; where it ends before one with a default, that."""
    get = f"get_{field_name(item.metadata['wire'])}(from)"
    return get if item.default is MISSING else f"more(from) ? {get} : {item.default}"


def source() -> str:
    """messages.c."""
    lines = [BORN, '#include "messages.h"\n']
    for kind in FROM_HOST:
        if fields(kind):
            name = snake(kind.__name__)
            lines.append(f"bool {name}_unpack(struct {name} *to, struct payload *from)\n{{")
            lines += [f"    to->{item.name} = {taken(item)};" for item in fields(kind)]
            lines.append("    return from->whole;\n}\n")
    for kind in FROM_DEVICE:
        name = snake(kind.__name__)
        lines.append(f"void {name}_pack(struct payload *to, const struct {name} *from)\n{{")
        for item in fields(kind):
            wire = item.metadata["wire"]
            given = f"from->{item.name}" if isinstance(wire, Scalar) else f"&from->{item.name}"
            lines.append(f"    put_{field_name(wire)}(to, {given});")
        lines.append("}\n")
    return "\n".join(lines)


def tables() -> str:
    """tables.c."""
    return "\n".join(
        [
            BORN,
            '#include "tables.h"\n',
            *table("uint32_t crc_table[256]", [f"0x{crc(byte):08x}" for byte in range(256)], 8),
            *table(f"uint16_t ramp_table[{RAMP_STEPS}]", [str(step_time(n)) for n in range(RAMP_STEPS)], 16),
            *table(
                f"int16_t thermistor_table[{THERMISTOR_POINTS}]",
                [str(centidegrees(n / (THERMISTOR_POINTS - 1))) for n in range(THERMISTOR_POINTS)],
                11,
            ),
        ]
    )


def table(declared: str, values: list[str], columns: int) -> Iterator[str]:
    """A constant array in flash."""
    yield f"FLASH const {declared} = {{"
    for at in range(0, len(values), columns):
        yield "    " + ", ".join(values[at : at + columns]) + ","
    yield "};\n"


def crc(byte: int) -> int:
    """What one byte does to the reflected CRC-32: eight divisions by its polynomial."""
    for _ in range(8):
        byte = (byte >> 1) ^ (0xEDB88320 if byte & 1 else 0)
    return byte


def step_time(step: int) -> int:
    """Duration of a step from rest at constant acceleration, relative to the first, of 65 535.

    Step n ends at sqrt(2 n / a), so it lasts sqrt(2 / a) (sqrt(n + 1) - sqrt(n)).
    """
    return round(65535 * (math.sqrt(step + 1) - math.sqrt(step)))


def centidegrees(ratio: float) -> int:
    """Temperature at which a thermistor towards ground under a resistor of its value at 25 °C gives this ratio.

    R = R25 exp(B (1/T - 1/T25)) and ratio = R / (R + R25); the ends of the scale are held at -40 and 125 °C.
    """
    coldest, hottest = -40.0, 125.0
    if ratio <= 0:
        return round(hottest * 100)
    if ratio >= 1:
        return round(coldest * 100)
    inverse = 1 / (KELVIN + 25) + math.log(ratio / (1 - ratio)) / THERMISTOR_BETA
    return round(max(coldest, min(hottest, 1 / inverse - KELVIN)) * 100)


def main(arguments: list[str]) -> int:
    """Write the files, or compare them."""
    made = {"messages.h": header(), "messages.c": source(), "tables.c": tables()}
    stale = [name for name, text in made.items() if not (CORE / name).exists() or (CORE / name).read_text() != text]
    for name in stale:
        if "--check" in arguments:
            sys.stderr.write(f"{CORE.name}/{name} is not what generate.py makes; run it and build again\n")
        else:
            (CORE / name).write_text(made[name])
    return 1 if stale and "--check" in arguments else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
