"""The combinations of controller, ranging board and turntable for which there is a prebuilt image."""

from dataclasses import dataclass
from enum import StrEnum

from sonarhw.errors import InputError


class Controller(StrEnum):
    """A controller board. An Uno and a Nano run the same image, but have different bootloaders."""

    UNO = "uno"
    NANO = "nano"
    MEGA = "mega"


class Ranging(StrEnum):
    """A ranging board."""

    POLAROID = "polaroid"
    HC_SR04 = "hc-sr04"


class Turning(StrEnum):
    """What turns the transducer."""

    STEP_DIR = "step-dir"  # a stepper driver and two home switches
    BYJ_28 = "28byj"  # four pins, no home switches
    SERVO = "servo"


IMAGES = (
    "mega-polaroid-step-dir",
    "mega-hc-sr04-step-dir",
    "uno-polaroid-step-dir",
    "uno-hc-sr04-step-dir",
    "uno-hc-sr04-28byj",
    "uno-hc-sr04-servo",
)


@dataclass(frozen=True)
class Combination:
    """What a scanner is built of. Raises InputError if there is no image for it."""

    controller: Controller
    ranging: Ranging = Ranging.POLAROID
    turning: Turning = Turning.STEP_DIR

    def __post_init__(self) -> None:
        if self.image not in IMAGES:
            raise InputError(f"no prebuilt firmware for {self.image}; there are {', '.join(IMAGES)}")

    @property
    def image(self) -> str:
        """Name of the image, `images/NAME.hex`."""
        chip = Controller.UNO if self.controller is Controller.NANO else self.controller
        return f"{chip}-{self.ranging}-{self.turning}"
