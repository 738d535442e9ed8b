"""A log of many readings in a room, most of them as predicted, made without a scanner."""

import math
from pathlib import Path

import numpy as np
from sonarhw_gui.model.scene import Scene
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.log import Log, LogMetadata, read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import Reading

SHORT = slice(100, 160)  # readings whose range is a third too short


def dense_readings(scene: Scene, count: int, sweep: int = 3600) -> list[Reading]:
    """Return `count` readings, `sweep` a turn."""
    angles = np.arange(min(count, sweep)) * math.tau / sweep
    ranges = predict_scan(scene.room, scene.pose, scene.board, scene.pose.heading + angles).ranges
    ranges[SHORT] /= 1.5
    speed = scene.room.air.speed_of_sound
    echoes = [() if math.isnan(far) else (2 * far / speed,) for far in ranges.tolist()]
    return [Reading(k, k // sweep, 0, angles[k % sweep], 0.1 * k, echoes[k % sweep], speed) for k in range(count)]


def dense_log(path: Path, scene: Scene, count: int, sweep: int = 3600) -> Log:
    """Write these readings to a log and return it."""
    write_scan(path, LogMetadata("import", 0.0), dense_readings(scene, count, sweep))
    return read_log(path)
