"""Write the C that must agree with another source: messages with `sonarhw/wire/messages.py`, tables with formulas.

    python firmware/generate.py            write the files of GENERATED in core/
    python firmware/generate.py --check    list those that differ; ends with 1 if there are any

The results are in the repository, so that building the firmware needs no Python.
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


def messages_header() -> str:
    """messages.h: limits, codes, and a struct for each message."""
    lines = [f"#define {name} {value}{'u' * (value > 0x7FFFFFFF)}" for name, value in constants().items()] + [""]
    lines.append("enum message_type {")
    lines += [f"    {snake(kind.__name__).upper()} = 0x{kind.TYPE:02x}," for kind in FROM_HOST + FROM_DEVICE] + ["};\n"]
    for codes in enumerations():
        name = snake(codes.__name__)
        lines.append(f"enum {name} {{")
        lines += [f"    {name.upper()}_{code.name} = {code.value}," for code in codes] + ["};\n"]
    for kind in FROM_HOST + FROM_DEVICE:
        lines += structure(kind)
    return header("messages", '#include "fields.h" // struct text', lines)


def header(name: str, includes: str, lines: list[str]) -> str:
    """A header file."""
    guard = f"{name.upper()}_H"
    return "\n".join([BORN, f"#ifndef {guard}", f"#define {guard}\n", includes, "", *lines, "#endif", ""])


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


def handler(kind: type[Message]) -> str:
    """The declaration of the function that carries out a command."""
    name = snake(kind.__name__)
    command = f", const struct {name} *command" if fields(kind) else ""
    return f"void on_{name}(const struct command_frame *frame{command})"


def commands_header() -> str:
    """commands.h: reads commands, and declares the handler of each."""
    lines = ["union command {"]
    lines += [f"    struct {snake(kind.__name__)} {snake(kind.__name__)};" for kind in FROM_HOST if fields(kind)]
    lines += ["};\n", "enum command_reading { COMMAND_READ, COMMAND_CUT_OFF, COMMAND_UNKNOWN };\n"]
    lines.append("// Read the payload of a frame.")
    lines.append("enum command_reading command_read(const struct command_frame *frame, union command *to);")
    lines.append("// Call the handler of a command that was read.")
    lines.append("void command_handle(const struct command_frame *frame, const union command *command);\n")
    lines.append("// The handlers: each answers its command, or refuses it.")
    lines += [f"{handler(kind)};" for kind in FROM_HOST] + [""]
    includes = '#include "frames.h" // struct command_frame\n#include "messages.h" // the commands'
    return header("commands", includes, lines)


def commands_source() -> str:
    """commands.c."""
    lines = [BORN, '#include "commands.h"\n']
    for kind in FROM_HOST:
        if fields(kind):
            name = snake(kind.__name__)
            lines.append(f"static bool read_{name}(struct {name} *to, struct payload *from)\n{{")
            lines += [f"    to->{item.name} = {taken(item)};" for item in fields(kind)]
            lines.append("    return from->whole;\n}\n")
    lines.append("enum command_reading command_read(const struct command_frame *frame, union command *to)\n{")
    lines.append("    struct payload from = payload_of((uint8_t *)frame->payload, frame->size);")
    lines.append("    bool whole = true;")
    lines.append("    switch (frame->type) {")
    for kind in sorted(FROM_HOST, key=lambda kind: not fields(kind)):
        name = snake(kind.__name__)
        lines.append(f"    case {name.upper()}:")
        if fields(kind):
            lines += [f"        whole = read_{name}(&to->{name}, &from);", "        break;"]
    lines += ["        break;", "    default:", "        return COMMAND_UNKNOWN;", "    }"]
    lines.append("    return whole ? COMMAND_READ : COMMAND_CUT_OFF;\n}\n")
    lines.append("void command_handle(const struct command_frame *frame, const union command *command)\n{")
    lines.append("    switch (frame->type) {")
    for kind in FROM_HOST:
        name = snake(kind.__name__)
        lines.append(f"    case {name.upper()}:")
        lines += [f"        on_{name}(frame{f', &command->{name}' if fields(kind) else ''});", "        break;"]
    lines.append("    }\n}\n")
    return "\n".join(lines)


def send_header() -> str:
    """send_messages.h: a function for each message from the device."""
    lines = ["// Each waits for the message before it. Echoes and samples must stay where they are until outbox_idle."]
    lines += [f"{sender(kind)};" for kind in FROM_DEVICE] + [""]
    return header("send_messages", '#include "messages.h" // the messages', lines)


def sender(kind: type[Message]) -> str:
    """The declaration of the function that sends a message."""
    return f"void send_{snake(kind.__name__)}(const struct {snake(kind.__name__)} *message)"


def send_source() -> str:
    """send_messages.c."""
    lines = [BORN, '#include "send_messages.h"\n\n#include "outbox.h" // outbox_send\n']
    for kind in FROM_DEVICE:
        lines.append(f"{sender(kind)}\n{{\n    struct payload payload = outbox_payload();")
        for item in fields(kind):
            wire = item.metadata["wire"]
            given = f"message->{item.name}" if isinstance(wire, Scalar) else f"&message->{item.name}"
            lines.append(f"    put_{field_name(wire)}(&payload, {given});")
        lines.append(f"    outbox_send({snake(kind.__name__).upper()}, &payload);\n}}\n")
    return "\n".join(lines)


def table(name: str, declared: str, values: list[str], columns: int) -> str:
    """A constant array in flash, in a file of its own."""
    rows = [", ".join(values[at : at + columns]) for at in range(0, len(values), columns)]
    lines = [BORN, f'#include "{name}.h"\n', f"FLASH const {declared} = {{", *(f"    {row}," for row in rows), "};\n"]
    return "\n".join(lines)


def crc_table() -> str:
    """crc_table.c."""
    return table("crc_table", "uint32_t crc_table[256]", [f"0x{crc(byte):08x}" for byte in range(256)], 8)


def ramp_table() -> str:
    """ramp_table.c."""
    return table("ramp_table", f"uint16_t ramp_table[{RAMP_STEPS}]", [str(step_time(n)) for n in range(RAMP_STEPS)], 16)


def thermistor_table() -> str:
    """thermistor_table.c."""
    values = [str(centidegrees(n / (THERMISTOR_POINTS - 1))) for n in range(THERMISTOR_POINTS)]
    return table("thermistor_table", f"int16_t thermistor_table[{THERMISTOR_POINTS}]", values, 11)


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


GENERATED = {
    "wire/messages.h": messages_header,
    "conversation/commands.h": commands_header,
    "conversation/commands.c": commands_source,
    "sending/send_messages.h": send_header,
    "sending/send_messages.c": send_source,
    "wire/crc_table.c": crc_table,
    "motion/ramp_table.c": ramp_table,
    "board/thermistor_table.c": thermistor_table,
}


def main(arguments: list[str]) -> int:
    """Write the files, or compare them."""
    made = {name: make() for name, make in GENERATED.items()}
    stale = [name for name, text in made.items() if not (CORE / name).exists() or (CORE / name).read_text() != text]
    for name in stale:
        if "--check" in arguments:
            sys.stderr.write(f"core/{name} differs from what firmware/generate.py writes; run it and build again\n")
        else:
            (CORE / name).write_text(made[name])
    return 1 if stale and "--check" in arguments else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
