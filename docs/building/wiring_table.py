"""The wires of each part of a scanner. `draw_wiring.py` draws them; the pins are those of the firmware's pins.h."""

from dataclasses import dataclass

TO_5V, TO_GROUND = "to 5 V", "to ground"


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

COMBINATIONS = (
    Combination("mega", "polaroid", "step-dir"),
    Combination("mega", "hc-sr04", "step-dir"),
    Combination("uno", "polaroid", "step-dir"),
    Combination("uno", "hc-sr04", "step-dir"),
    Combination("uno", "hc-sr04", "28byj"),
    Combination("uno", "hc-sr04", "servo"),
)


def left_parts(combination: Combination) -> list[Part]:
    """Return the parts to the left of the controller, from top to bottom."""
    with_traces = (combination.controller, combination.ranging) == ("mega", "polaroid")
    return [RANGING[combination.ranging], THERMISTOR, *([TRACE] if with_traces else [])]


def right_parts(combination: Combination) -> list[Part]:
    """Return the parts to the right of the controller, from top to bottom."""
    return [*TURNING[combination.turning]]
