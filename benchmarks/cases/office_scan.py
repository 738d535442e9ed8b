"""The whole scan of the speed table: 360 headings from the desk, 8 reflections, paths of 20 m.

A separate file, so that a process that measures its memory loads nothing else.
"""

from dataclasses import replace

import numpy as np
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Room

from benchmarks.cases.office import PLACE

BOARD = replace(load_board("polaroid-6500"), max_range=10.0)
HEADINGS = np.radians(np.arange(360.0))
# with the spacing of the rays of one heading, so that the same work is compared
OPTIONS = PredictionOptions(max_bounces=8, rays=1440, receiver=Receiver.FIRST_ECHO)


def scan(room: Room) -> PredictedScan:
    """Return a whole scan, 360 headings."""
    return predict_scan(room, PLACE, BOARD, HEADINGS, OPTIONS)
