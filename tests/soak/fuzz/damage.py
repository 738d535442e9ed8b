"""Damage of bytes and of text files: flipped bits, missing parts, other encodings, values that do not fit."""

import re
from random import Random

from tests.soak.fuzz.boundaries import NUMBERS, TOML_VALUES
from tests.soak.test_hostile_bytes import mutate

_NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?")
_VALUE = re.compile(r"(?<== ).+")


def damaged_bytes(chance: Random, data: bytes) -> bytes:
    """Return bytes with random damage, which no longer match any checksum."""
    match chance.randrange(4):
        case 0:
            return data[: chance.randrange(len(data) + 1)]
        case 1:
            begin = chance.randrange(len(data) + 1)
            return data[:begin] + bytes(chance.randrange(200)) + data[begin + chance.randrange(200) :]
        case 2:
            return data + data[chance.randrange(len(data)) :] if data else b"\0"
    return mutate(chance, data)


def damaged_toml(chance: Random, text: str) -> bytes:
    """Return a TOML file with one to three changes of its values, lines or encoding."""
    for _ in range(chance.randrange(1, 4)):
        text = _other_value(chance, text) if chance.random() < 0.7 else _other_lines(chance, text)
    return _encoded(chance, text)


def damaged_csv(chance: Random, text: str) -> bytes:
    """Return a CSV file with one to three changes of its fields, lines or encoding."""
    for _ in range(chance.randrange(1, 4)):
        lines = text.splitlines()
        row = chance.randrange(len(lines)) if lines else 0
        fields = lines[row].split(",") if lines else [""]
        column = chance.randrange(len(fields))
        match chance.randrange(8):
            case 0 | 1 | 2:
                fields[column] = chance.choice((*NUMBERS, "1,5", '"1,5"', "=1", '"', '"a\nb"', "\x1b", "x" * 200_000))
            case 3:
                fields += ["1"] * chance.randrange(1, 4)
            case 4:
                del fields[column]
            case 5:
                text = text.replace(",", chance.choice((";", "\t", ",,", ", "))).replace(".", chance.choice(".,"))
                continue
            case 6:
                fields[column] = fields[0]
            case 7:
                text = _other_lines(chance, text)
                continue
        lines[row : row + 1] = [",".join(fields)]
        text = "\n".join(lines) + "\n"
    return _encoded(chance, text)


def _other_value(chance: Random, text: str) -> str:
    found = [*(_NUMBER if chance.random() < 0.5 else _VALUE).finditer(text)]
    if not found:
        return text
    place = chance.choice(found)
    return text[: place.start()] + chance.choice(TOML_VALUES) + text[place.end() :]


def _other_lines(chance: Random, text: str) -> str:
    lines = text.splitlines() or [""]
    at = chance.randrange(len(lines))
    match chance.randrange(5):
        case 0:
            del lines[at]
        case 1:
            lines.insert(at, lines[chance.randrange(len(lines))])
        case 2:
            lines.insert(at, chance.choice(("a = 1", "[x]", "[[walls]]", "[[posts]]", "\0", "=", "x" * 100_000, "[")))
        case 3:
            chance.shuffle(lines)
        case 4:
            lines = lines[:at]
    return "\n".join(lines) + "\n"


def _encoded(chance: Random, text: str) -> bytes:
    if chance.random() < 0.9:
        return text.encode(errors="surrogatepass")
    match chance.randrange(5):
        case 0:
            return text.encode("utf-16")
        case 1:
            return b"\xef\xbb\xbf" + text.encode()
        case 2:
            return text.replace("\n", "\r\n").encode()
        case 3:
            return text.encode() + b"\xff\xfe\0"
    return damaged_bytes(chance, text.encode())
