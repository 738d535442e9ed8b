"""A film of one ping: the plan with the sound on its paths, and the trace with a cursor in step."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from sonarhw_compare.drawings import draw_room
from sonarhw_compare.pictures import MEASURED, PREDICTED, floor_of, in_db, picture_text
from sonarhw_compare.sound import PlayedPing, Pulse, caption_at, counted_position, moment_at

# A film of one ping: the plan with the sound on its paths, and the trace with a cursor in step.
#
# The static parts are drawn once. Each frame adds what moves to a copy of them, which is ten times as fast.


SIZE = 8.2, 3.8  # inches
_DPI = 100
_BLANKED, _FAINT, _SHADE = "#8C8C8C", "#BBBBBB", "#E4E4E4"
_MARGIN = 0.08  # share of the size of the plan

Frame = NDArray[np.uint8]  # (height, width, 3)


@dataclass(frozen=True)
class FilmTiming:
    """How time passes in a film."""

    slowness: float = 1000.0  # seconds of film for each second of sound
    frames_per_second: int = 15
    hold: float = 1.5  # s, the last frame

    def times(self, ping: PlayedPing) -> list[float]:
        """Return the time of each frame, s of sound."""
        count = max(2, math.ceil(ping.duration * self.slowness * self.frames_per_second))
        moving = np.linspace(0.0, ping.duration, count).tolist()
        return [*moving, *moving[-1:] * round(self.hold * self.frames_per_second)]


def frames(ping: PlayedPing, timing: FilmTiming) -> Iterator[Frame]:
    """Yield the frames of a film."""
    stage = _Stage(ping)
    for time in timing.times(ping):
        yield stage.frame(time)


class _Stage:
    """The figure with its static parts, and the parts that move."""

    def __init__(self, ping: PlayedPing) -> None:
        self._ping = ping
        self._figure = Figure(figsize=SIZE, dpi=_DPI, layout="compressed")
        self._canvas = cast(Any, FigureCanvasAgg)(self._figure)  # it has no types
        self._plan, self._trace = self._figure.subplots(1, 2, width_ratios=(1.0, 1.25))
        self._figure.suptitle(" ", fontsize=12)  # reserves space for the caption
        self._moving = [*self._draw_plan(self._plan), *self._draw_trace(self._trace)]
        self._caption = self._figure.text(0.5, 0.965, "", ha="center", va="top", fontsize=11.5)
        self._canvas.draw()
        for artist in (*self._moving, self._caption):
            artist.set_animated(True)
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self._figure.bbox)

    def frame(self, time: float) -> Frame:
        """Return the picture at a time, s."""
        self._canvas.restore_region(self._still)
        self._move_plan(time)
        self._move_trace(time)
        self._caption.set_text(picture_text(caption_at(self._ping, time)))
        for artist in (*self._moving, self._caption):
            cast(Any, artist).figure.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _draw_plan(self, axes: Axes) -> list[Artist]:
        ping = self._ping
        draw_room(axes, ping.prediction.room, ping.prediction.place)
        if axes.get_legend_handles_labels()[0]:  # of walls and posts that the transducer is not level with
            axes.legend(loc="upper right", fontsize=8)
        x, y = ping.prediction.standpoints[ping.index]
        deaf = ping.prediction.board.blanked_range(ping.prediction.room.air)
        axes.add_patch(Circle((x, y), deaf, fc=_SHADE, ec=_FAINT, ls="--", zorder=0))
        for way in ping.ways:
            axes.plot(*way.points.T, "-", color=_FAINT, lw=0.9, zorder=1)
        axes.plot(x, y, "D", color="k", ms=7, zorder=6)
        (self._beam,) = axes.plot([], [], ":", color=MEASURED, lw=1.2)
        (self._counted,) = axes.plot([], [], "o", mec=MEASURED, mfc="none", mew=1.6, ms=9)
        self._pulses = [
            (*axes.plot([], [], "-", lw=4, zorder=4), *axes.plot([], [], "-", lw=1.6, zorder=5)) for _ in ping.ways
        ]
        self._frame_plan(axes)
        axes.set(xlabel="x (m)", ylabel="y (m)")
        return [self._beam, self._counted, *(line for pair in self._pulses for line in pair)]

    def _frame_plan(self, axes: Axes) -> None:
        """Show the room, the sensor and the point that the board reports."""
        ping = self._ping
        room = ping.prediction.room
        ends = [room.walls.reshape(-1, 2), ping.prediction.standpoints, counted_position(ping, ping.duration)[None]]
        points = np.vstack(ends if ping.detected is not None else ends[:2])
        low, high = points.min(axis=0), points.max(axis=0)
        margin = _MARGIN * float((high - low).max())
        axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
        axes.set_aspect("equal", adjustable="box")

    def _draw_trace(self, axes: Axes) -> list[Artist]:
        ping, board = self._ping, self._ping.prediction.board
        signal, floor = ping.prediction.ping(ping.index).signal(ping.duration).envelope(), floor_of(board)
        axes.axvspan(0, ping.blanking * 1e3, color=_SHADE, lw=0)
        axes.text(ping.blanking * 500, floor + 3, "blanking", ha="center", color="#555555", fontsize=9)
        axes.axhline(board.threshold_db, color="#777777", ls="--", lw=1)
        axes.text(ping.blanking * 1e3, board.threshold_db + 1, " threshold", color="#555555", fontsize=9)
        self._times, self._levels = signal.times * 1e3, in_db(signal.samples, floor)
        axes.plot(self._times, self._levels, color=_FAINT, lw=1)
        (self._heard,) = axes.plot([], [], color=PREDICTED, lw=1.5)
        self._cursor = axes.axvline(0, color="k", lw=1)
        (self._crossing,) = axes.plot([], [], "o", mec=MEASURED, mfc="none", mew=1.8, ms=11)
        axes.set(xlim=(0, ping.duration * 1e3), ylim=(floor, 4), xlabel="time (ms)", ylabel="level (dB)")
        return [self._heard, self._cursor, self._crossing]

    def _move_plan(self, time: float) -> None:
        ping = self._ping
        for (trail, front), pulse in zip(self._pulses, moment_at(ping, time), strict=True):
            colour = _pulse_colour(pulse)
            trail.set_data(*pulse.trail.T)
            front.set_data(*pulse.front.T)
            trail.set_color(colour)
            front.set_color(colour)
        here = counted_position(ping, time)
        sensor = ping.prediction.standpoints[ping.index]
        self._beam.set_data(*np.array([sensor, here]).T)
        self._counted.set_data(*here[:, None])
        reported = ping.detected is not None and time >= ping.detected
        self._counted.set_markerfacecolor(MEASURED if reported else "none")

    def _move_trace(self, time: float) -> None:
        ping = self._ping
        now = time * 1e3
        past = self._times <= now
        self._heard.set_data(self._times[past], self._levels[past])
        self._cursor.set_xdata([now, now])
        reported = ping.detected is not None and time >= ping.detected
        mark = ([cast(float, ping.detected) * 1e3], [ping.prediction.board.threshold_db]) if reported else ([], [])
        self._crossing.set_data(*mark)


def _pulse_colour(pulse: Pulse) -> str:
    return PREDICTED if pulse.way.echo.wins else _BLANKED
