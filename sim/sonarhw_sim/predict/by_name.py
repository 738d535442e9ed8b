"""A prediction in one call, from names, files or objects: `predict` of `sonarhw`."""

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.choices import DEFAULT_BOARD, Model
from sonarhw_sim.predict.models import predict_with
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.doubts import place_doubts
from sonarhw_sim.room.model import Place, Room, load_room

_STEP = 5  # degrees, as in `sonarhw simulate`


def predict(
    room: Room | Path | str,
    place: Place | tuple[float, float] | str | None = None,
    board: Board | Path | str = DEFAULT_BOARD,
    headings: ArrayLike | None = None,
    *,
    model: Model = Model.RAY_FOLLOWING,
    options: PredictionOptions | None = None,
) -> PredictedScan:
    """Return the scan that a board is predicted to report at a place of a room.

    Room and board are objects, names or files. The place is a name, its x and y in m, or an object; by default the only
    place of the room. `headings` (n,) are rad in the room, by default a whole turn in steps of 5 degrees, or those of
    the sensors of a ring. The default options have the receiver of the board profile. Raises InputError.
    Emits a Python warning if the place is outside the room or inside an object.
    """
    room = room if isinstance(room, Room) else load_room(room)
    profile = board if isinstance(board, Board) else load_board(board)
    here = room.place(place)
    for doubt in place_doubts(room, here):
        warnings.warn(doubt, stacklevel=2)
    if headings is None:
        headings = np.radians(np.arange(0, 360, _STEP)) if profile.ring is None else profile.ring.headings(here)
    return predict_with(model, room, here, profile, np.atleast_1d(np.asarray(headings, dtype=np.float64)), options)
