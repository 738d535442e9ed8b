"""A picture as a plain array, safe to pass between threads."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Pixels: TypeAlias = NDArray[np.uint8]  # (height, width, 4), the top row first: red, green, blue, opacity
