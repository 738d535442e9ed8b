"""Predict what an ultrasonic ranging board reports in a room, by following sound.

    import numpy as np
    from sonarhw_sim import load_board, load_room, predict_scan

    room = load_room("rooms/simple.toml")
    scan = predict_scan(room, room.place("figure9"), load_board("polaroid-6500"), np.radians(np.arange(0, 360, 5)))
    scan.ranges  # (72,) m, NaN where the board detects no echo

The names in `__all__` are public; they are loaded when they are first used. All modules are private and may change.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
