"""The choices that every prediction offers, each defined once: model, receiver, unit and edge strength.

This module imports nothing heavy, so a command line can list the choices before it loads any kernel.
"""

from enum import StrEnum
from typing import Self

ROOM_TOLERANCE = 0.005  # m, standard deviation of the position of each wall of a room file; assumed
DEFAULT_BOARD = "polaroid-6500"  # the board profile if a user names none


class Model(StrEnum):
    """How to predict a scan: following the sound, or a simpler baseline model to compare with.

    To add a model, add a line here and its function, decorated with `predicts(Model.NAME)`, to
    `sonarhw_sim.predict.models`. Command line, study files and comparison take it from here.
    """

    follows_sound: bool  # whether it has paths; only these depend on the unit and the near field

    RAY_FOLLOWING = "ray-following"
    NEAREST = "nearest", False  # the first wall along the axis; with a seed, its distance has random errors
    CONE = "cone", False  # the nearest wall within ±15°
    KUC_SIEGEL = "kuc-siegel"  # single reflections and edges only

    def __new__(cls, name: str, follows_sound: bool = True) -> Self:
        """Make the model of a name."""
        member = str.__new__(cls, name)
        member._value_ = name
        member.follows_sound = follows_sound
        return member


class Receiver(StrEnum):
    """How a board derives a range from the receive signal."""

    FIRST_ECHO = "first-echo"  # the paper's: the first arrival over the threshold, after an ideal gain
    BOARD = "board"  # the ranging board's own: stepped gain, integration, its own clock (sonarhw_sim.board.receiver)


class Unit(StrEnum):
    """The effect of the transducer's body on sound that passes it."""

    PASS = "pass"  # none: it is small, and sound closes around it
    BLOCK = "block"  # sound that meets its face ends there
    REFLECT = "reflect"  # both sides of its face reflect like a wall: appendix A as printed


class EdgeStrength(StrEnum):
    """How strongly an edge diffracts sound."""

    UNIFORM = "uniform"  # by angles, distances and reflectances of its faces, continuous with reflection
    KELLER = "keller"  # by the angles to its faces, too loud near reflection
    PAPER = "paper"  # the same in all directions
