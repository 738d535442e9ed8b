"""The controllers for which there is a prebuilt image."""

from enum import StrEnum


class Controller(StrEnum):
    """A controller for which there is a prebuilt image, `images/NAME.hex`."""

    MEGA = "mega"
