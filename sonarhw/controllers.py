"""The combinations of controller, ranging board and turntable for which there is a prebuilt image."""

from dataclasses import dataclass
from typing import Literal

from sonarhw.errors import InputError

# an Uno and a Nano run the same image, but have different bootloaders
Controller = Literal["uno", "nano", "mega"]
Ranging = Literal["polaroid", "hc-sr04"]
# a stepper driver and two home switches; four pins and no home switches; a servo
Turning = Literal["step-dir", "28byj", "servo"]
POLAROID: Ranging = "polaroid"
STEP_DIR: Turning = "step-dir"

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
    ranging: Ranging = POLAROID
    turning: Turning = STEP_DIR

    def __post_init__(self) -> None:
        if self.image not in IMAGES:
            raise InputError(f"no prebuilt firmware for {self.image}; there are {', '.join(IMAGES)}")

    @property
    def image(self) -> str:
        """Name of the image, `images/NAME.hex`."""
        chip = "uno" if self.controller == "nano" else self.controller
        return f"{chip}-{self.ranging}-{self.turning}"
