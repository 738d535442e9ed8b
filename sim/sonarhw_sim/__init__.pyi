# The public names; each is loaded when it is first used.
from .air import Air, EdgeStrength, Model, Receiver, Unit
from .board.profile import Board, Mount, Ring, board_names, load_board, parse_board
from .board.signal import Signal
from .predict.predicted_scan import Echo, PredictedPing, PredictedScan
from .predict.prediction import PredictionOptions, paths_for, predict_scan, predict_with
from .predict.room_echoes import Disturbance, RoomEchoes
from .rays.paths import Paths
from .room.room import Place, Room, load_room, parse_room, room_names
from .room.room_writing import save_room

__all__ = [
    "Air",
    "Board",
    "Disturbance",
    "Echo",
    "EdgeStrength",
    "Model",
    "Mount",
    "Paths",
    "Place",
    "PredictedPing",
    "PredictedScan",
    "PredictionOptions",
    "Receiver",
    "Ring",
    "Room",
    "RoomEchoes",
    "Signal",
    "Unit",
    "board_names",
    "load_board",
    "load_room",
    "parse_board",
    "parse_room",
    "paths_for",
    "predict_scan",
    "predict_with",
    "room_names",
    "save_room",
]
