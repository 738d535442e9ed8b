"""Values at the boundaries of what numbers, names and URLs may be."""

import os
from random import Random

NUMBERS = (
    *(
        "0",
        "-0",
        "-0.0",
        "1",
        "-1",
        "1e-300",
        "1e-9",
        "0.5",
        "3",
        "90",
        "1e3",
        "65535",
        "65536",
        "-32769",
        "2147483648",
    ),
    *("1e9", "4294967296", "1e15", "9223372036854775808", "1e154", "1e300", "1e308", "-1e308", "1e400", "-1e400"),
    *("nan", "inf", "-inf", "1_0", "1,5", "0x10", "٣", "", " ", "1e", "--", "+", "1e5000", 400 * "9"),
)
NAMES = (
    *(
        "",
        " ",
        ".",
        "..",
        "/",
        "-",
        "--",
        "~",
        "x" * 300,
        "x" * 5000,
        "figure9",
        "nowhere",
        "0.5,0.4",
        "nan,nan",
        "1e400,0",
    ),
    *(
        "1e308,1e308",
        "0.5",
        "0.5,0.4,1",
        ",",
        "\x1b[31m",
        "$\\frac$",
        "$",
        "a\nb",
        "=1+1",
        "\u202eabc",
        "\U0001f600",
        "nan",
    ),
    *("position", "heading", "heading,offset", "position,position", "x", "offset", "wall", "reflectance", "a,b,,"),
    *(os.fsdecode(b"\xff\xfe"), "a\0b", "/dev/null", "/dev/zero", "/proc/self/mem", "paper", "lego-nxt", "hc-sr04"),
)
SPECIAL_FILES = ("/dev/null", "/dev/zero", "/dev/full", "/proc/self/mem", "/", "missing", "pipe", "x" * 300, "", "a\0b")
DEVICES = ("/dev/null", "/dev/full")
# nothing outside the folder of the case may be written
OUTPUTS = (*DEVICES, "missing", "x" * 300, "", "a\0b")
PRIORS = (
    *("x=0..1", "x=1..0", "x=0..1e400", "x=nan..1", "x=0±1", "x=0+-1", "x=", "=1", "x", "nothing=1..2", "x=1..1"),
    *("heading=0..1e308", "heading=10±0", "offset=0±1e-300", "temperature=20±5", "x=-inf..inf", "threshold=0..-1"),
)
POSES = ("0.5,0.4,0", "0.5,0.4", "a,b,c", "nan,0,0", "1e308,0,0", "0.5,0.4,1e400", "", ",,", "1,2,3,4")
ADDRESSES = (
    *("127.0.0.1:0", "127.0.0.1:99999", "127.0.0.1:-1", "127.0.0.1:x", ":0", "127.0.0.1", "", f"{70 * 'a'}.example:0"),
    *("[::1]:0", "256.0.0.1:0", "..:0", "\x1b:0", "a\0b:0", "é.example:0", "*:0", "127.0.0.1:0:0"),
)
FAULTS = (
    *("drop=0.1", "drop=2", "drop=nan", "drop=", "x=1", "flip=1e-3,insert=1e-3", "drift=1e400", "drift=100", "reset=1"),
    *(
        "reset@1",
        "reset=1@~0",
        "unplug=1@r0",
        "stall=-1",
        "slip=1e99",
        "protocol=0.9",
        "protocol=x",
        "mute=1@2@3",
        ",,",
    ),
    *("wedge=0.1@0.1", "reset@~1e-9", "stall=1e308@0"),
)
PACES = ("max", "1", "0", "-1", "nan", "inf", "1e400", "fast", "", "1e-300")
URLS = (
    *("", "/dev/null", "/dev/zero", "/", "missing", "COM1", "socket://127.0.0.1:1", "socket://127.0.0.1", "socket://"),
    *(f"socket://{70 * 'a'}:1", "socket://..:1", "socket://[::1:1", "socket://127.0.0.1:99999", "socket://127.0.0.1:x"),
    *("rfc2217://127.0.0.1:1", "rfc2217://", "hwgrep://(", "hwgrep://nothing", "hwgrep://", "loop://", "loop://?x=1"),
    *("alt://x", "cp2110://x", "http://127.0.0.1", "fake:", "fake:?"),
    *("\x1b[2J", "a\0b", os.fsdecode(b"\xff"), "socket://\udcff:1", "socket://é:1", "x" * 5000, "fake:missing?place=x"),
    *("hwgrep://(a%2B)%2B$", "hwgrep://(a|a)*b", "hwgrep://x&n=0", "hwgrep://x&skip_busy", "lines:", "lines:?baud=1"),
    *("spy://missing?file=pipe", "spy://missing?file=/dev/null", "alt:///dev/null?class=Serial"),
)
# keys of a `lines:` URL
LINES = {
    "preset": ("arduino-radar", "csv", "jsonl", "nothing", "", "%1b"),
    "pattern": (
        *("Angle: {deg} Dist: {cm}", "{deg},{cm}", "{cm}", "{", "}", "{deg}{deg}{cm}", "{nothing}", "", "{deg}...{cm}"),
        *("(?P<heading_deg>(\\d%2B)%2B),(?P<range_cm>\\d%2B)", "(?P<range_cm>", "(?P<range_x>.)", "(a{9999}){9999}"),
    ),
    "baud": ("9600", *NUMBERS),
    "step": ("5", *NUMBERS),
    "zero": ("90", *NUMBERS),
    "unit": ("cm", "us", "furlong", "", "%00"),
    "angle": ("deg", "rad", "gon", "step", "x"),
    "turn": ("cw", "ccw", "", "left"),
    "no_echo": ("0", *NUMBERS),
    "ends": (".", "%0a", "", "ab", "%ff", "%1b"),
    "x": ("1", ""),
}
TOML_VALUES = (
    *(
        "nan",
        "inf",
        "-inf",
        "-0.0",
        "0",
        "-1",
        "1e308",
        "1e-308",
        "1e154",
        "1e400",
        "99999999999999999999999999",
        "true",
    ),
    *('""', '"x"', '"\\u001b[31m$=+"', "[]", "{}", "[[]]", "[0, 0, 0]", "[nan, 0]", "2026-01-01", "1_000", "0x10"),
    *("[1e308, -1e308]", "[[0, 0], [1, 0]]", f'"{3000 * "n"}"', f"{'[' * 400}{']' * 400}", f"{'[' * 9000}", "0.1", "3"),
)


class Chance(Random):
    """The random choices of one case. In a cautious case most parts are usual, so that the command does its work."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self._caution = self.choice((1.0, 0.3, 0.1))

    def hostile(self, share: float) -> bool:
        """Return whether a part is hostile, with probability `share` in a case that is not cautious."""
        return self.random() < share * self._caution


def any_of(chance: Chance, values: tuple[str, ...], usual: str, share: float = 0.5) -> str:
    """Return `usual`, or with probability `share` one of `values`."""
    return chance.choice(values) if chance.hostile(share) else usual
