"""The wires of each part of a scanner. `draw_wiring.py` draws them; the pins are those of the firmware's pins.h."""

from dataclasses import dataclass, replace

TO_5V, TO_3V3, TO_GROUND = "to 5 V", "to 3.3 V", "to ground"


@dataclass(frozen=True)
class Wire:
    """A wire from a terminal of a part to the controller."""

    terminal: str
    signal: str  # a name in pins.h, or an analogue pin such as A1
    resistor: str = ""  # between the wire and 5 V or ground
    to: str = TO_5V
    from_part: bool = False  # the signal comes from the part


@dataclass(frozen=True)
class Supply:
    """A terminal that is not wired to the controller."""

    terminal: str
    tag: str  # where it is wired instead


@dataclass(frozen=True)
class Part:
    """A part with its terminals, from top to bottom."""

    title: str
    subtitle: str
    terminals: tuple[Wire | Supply, ...]


@dataclass(frozen=True)
class Controller:
    """The board with the chip."""

    title: tuple[str, str]
    chip: str  # folder of its pins.h
    note: str = "The Arduino is powered by USB."


@dataclass(frozen=True)
class Combination:
    """A scanner that the firmware can be built for: `make CHIP=… RANGING=… TURNING=…`."""

    controller: str
    ranging: str
    turning: str

    @property
    def name(self) -> str:
        """The name of the drawing."""
        return f"{self.controller}-{self.ranging}-{self.turning}"


CONTROLLERS = {
    "mega": Controller(("Arduino", "Mega 2560"), "atmega2560"),
    "uno": Controller(("Arduino", "Uno or Nano"), "atmega328p"),
    "linux": Controller(("Raspberry Pi", "header"), "linux", "5 V at an input destroys the Raspberry Pi."),
}

RANGING = {
    "polaroid": Part(
        "6500 ranging board",
        "connector J1; 3, 5 and 6 stay open",
        (
            Supply("1  ground", "ground"),
            Wire("2  BLNK", "BLNK"),
            Wire("4  INIT", "INIT", "10 kΩ", TO_GROUND),
            Wire("7  ECHO", "ECHO", "4.7 kΩ", TO_5V, from_part=True),
            Wire("8  BINH", "BINH"),
            Supply("9  5 V", "5 V, 2 A peak"),
            Supply("9 to 1", "470 µF to 1000 µF"),
        ),
    ),
    "hc-sr04": Part(
        "HC-SR04",
        "5 V module; others may be 3.3 V",
        (
            Supply("VCC", "5 V"),
            Wire("TRIG", "TRIGGER"),
            Wire("ECHO", "ECHO", from_part=True),
            Supply("GND", "ground"),
        ),
    ),
}

TURNING = {
    "step-dir": (
        Part(
            "Stepper driver",
            "A4988 or DRV8825 carrier",
            (
                Wire("STEP", "STEP"),
                Wire("DIR", "DIRECTION"),
                Wire("ENABLE", "ENABLE", "10 kΩ", TO_5V),
                Supply("RESET and SLEEP", "both to 5 V"),
                Supply("microsteps", "16, see table"),
                Supply("VDD (A4988)", "5 V"),
                Supply("ground", "ground"),
                Supply("VMOT", "12 V to 24 V"),
                Supply("VMOT to ground", "100 µF, 50 V"),
                Supply("1A 1B, 2A 2B", "motor coils"),
            ),
        ),
        Part(
            "Light barriers",
            "mark on axle, cam on gear",
            (
                Wire("mark, collector", "HOME_MARK", from_part=True),
                Wire("cam, collector", "HOME_SIDE", from_part=True),
                Supply("both emitters", "ground"),
                Supply("both anodes", "220 Ω each to 5 V"),
                Supply("both cathodes", "ground"),
            ),
        ),
    ),
    "28byj": (
        Part(
            "ULN2003 board",
            "with a motor 28BYJ-48, 5 V",
            (
                Wire("IN1", "COIL_1"),
                Wire("IN2", "COIL_2"),
                Wire("IN3", "COIL_3"),
                Wire("IN4", "COIL_4"),
                Supply("+", "5 V, 1 A"),
                Supply("−", "ground"),
                Supply("socket", "motor"),
            ),
        ),
    ),
    "servo": (
        Part(
            "Hobby servo",
            "180°, 0.5 ms to 2.5 ms",
            (
                Wire("orange or white", "SERVO"),
                Supply("red", "5 V, 1 A"),
                Supply("brown or black", "ground"),
                Supply("red to brown", "470 µF"),
            ),
        ),
    ),
}

THERMISTOR = Part(
    "Thermistor",
    "optional; 10 kΩ at 25 °C, B 3950",
    (Wire("one end", "A1", "10 kΩ", TO_5V, from_part=True), Supply("other end", "ground")),
)
TRACE = Part(
    "Buffer for traces",
    "optional; FET input at the tap",
    (Wire("output, 0 to 5 V", "A0", from_part=True), Supply("ground", "ground")),
)

# what a Raspberry Pi has instead, because its pins bear 3.3 V
AT_3V3: dict[str, Wire | Supply] = {
    "ECHO": Wire("ECHO, through 1 kΩ", "ECHO", "2 kΩ", TO_GROUND, from_part=True),
    "RESET and SLEEP": Supply("RESET and SLEEP", "both to 3.3 V"),
    "VDD (A4988)": Supply("VDD (A4988)", "3.3 V"),
}

COMBINATIONS = (
    Combination("mega", "polaroid", "step-dir"),
    Combination("mega", "hc-sr04", "step-dir"),
    Combination("uno", "polaroid", "step-dir"),
    Combination("uno", "hc-sr04", "step-dir"),
    Combination("uno", "hc-sr04", "28byj"),
    Combination("uno", "hc-sr04", "servo"),
    Combination("linux", "polaroid", "step-dir"),
    Combination("linux", "hc-sr04", "step-dir"),
    Combination("linux", "hc-sr04", "28byj"),
)


def left_parts(combination: Combination) -> list[Part]:
    """Return the parts to the left of the controller, from top to bottom."""
    if combination.controller == "linux":
        return [at_3v3(RANGING[combination.ranging])]
    with_traces = (combination.controller, combination.ranging) == ("mega", "polaroid")
    return [RANGING[combination.ranging], THERMISTOR, *([TRACE] if with_traces else [])]


def right_parts(combination: Combination) -> list[Part]:
    """Return the parts to the right of the controller, from top to bottom."""
    parts = TURNING[combination.turning]
    return [at_3v3(part) for part in parts] if combination.controller == "linux" else [*parts]


def at_3v3(part: Part) -> Part:
    """Return a part as it is wired to a controller of 3.3 V."""
    terminals = (AT_3V3.get(terminal.terminal, terminal) for terminal in part.terminals)
    return replace(part, terminals=tuple(map(_pulled_up_to_3v3, terminals)))


def _pulled_up_to_3v3(terminal: Wire | Supply) -> Wire | Supply:
    pulled_up = isinstance(terminal, Wire) and terminal.to == TO_5V
    return replace(terminal, to=TO_3V3) if pulled_up else terminal
