"""Whether a window can be shown at all."""

import os
import sys


def has_display() -> bool:
    """Whether there is a screen to open a window on; other systems than Linux always have one."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
