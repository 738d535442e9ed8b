"""A picture as plain numbers, which any thread may hold."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Pixels: TypeAlias = NDArray[np.uint8]  # (height, width, 4), the top row first: red, green, blue, opacity
