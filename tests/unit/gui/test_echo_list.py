"""The list of echoes at one heading: all rows state half of the path, also that of the winner."""

import numpy as np
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.views.echoes import EchoList
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

ROOM = load_room("rooms/simple.toml")


def test_the_winner_is_listed_by_the_rule_of_all_echoes() -> None:
    scan = predict_scan(ROOM, ROOM.place("figure9"), load_board("polaroid-6500"), np.radians([270.0]))
    listed = EchoList(scan, 0, LengthUnit.M)
    half, _, outcome, path = listed.cells(0)
    added = float(scan.ranges[0]) - 0.827
    assert (half, path) == ("0.827 m", "bottom>top>bottom")
    assert outcome == f"wins, receiver adds {added:.3f} m"
    second = listed.cells(1)
    assert second[2] == f"{float(second[0][:-2]) - 0.827:.3f} m behind the winner"
