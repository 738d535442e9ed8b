"""The selected trace, the answer to an asked heading, and the B-scan, computed in threads.

A new request replaces a waiting one. Answers for another scan are dropped.
"""

import time

from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import paths_serve_all_headings

from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.work.bscan_picture import BScans, BScanSettings
from sonarhw_gui.work.bscan_request import BScanRequest
from sonarhw_gui.work.chosen_trace import ChosenTrace, HeadingAnswered, HeadingAsked, TraceFound, TraceRequest
from sonarhw_gui.work.worker import Failure, Worker

_PAUSE = 0.05  # s between two traces; a person cannot see fifty readings per second


class TraceForecast:
    """Keeps trace and B-scan up to date with the shown content."""

    def __init__(self) -> None:
        self.trace: ChosenTrace | None = None
        self.answer: PredictedScan | None = None  # at the asked heading
        self.bscan: BScans | None = None
        self.failures: list[str] = []
        self._generation = 0
        self._shown: Shown | None = None
        self._settings: BScanSettings | None = None
        self._requested_trace: tuple[object, ...] = ()
        self._requested_at = -_PAUSE
        self._requested_bscan: tuple[object, ...] = ()
        self._drawing = False  # one B-scan at a time: the next continues it
        # two threads, so that a trace never waits for a B-scan
        self._tracer = Worker("traces")
        self._drawer = Worker("B-scans")

    def begin_scan(self) -> None:
        """Drop traces and B-scan; another scan follows."""
        self._generation += 1
        self.trace, self.answer, self.bscan, self._shown = None, None, None, None
        self._requested_trace, self._requested_bscan = (), ()

    def request_bscan(self, settings: BScanSettings | None) -> None:
        """Compute the B-scan with these settings from now on; None: it is not visible."""
        self._settings = settings
        self._request_bscan()

    def follow(self, shown: Shown) -> None:
        """Compute trace and B-scan for this content."""
        self._shown = shown
        self._request_trace(shown)
        self._request_bscan()

    def take(self) -> bool:
        """Fetch the answers since the last call; return whether anything has changed."""
        changed = False
        if self._shown is not None:
            self._request_trace(self._shown)  # if it came too soon after the previous request
        for answer in (*self._tracer.take(), *self._drawer.take()):
            match answer:
                case Failure(request=BScanRequest()):
                    self._drawing = False
                    self.failures.append(answer.message)
                case Failure():
                    self.failures.append(answer.message)
                    self.trace, changed = None, True
                case TraceFound(generation=self._generation) if not self._asking:
                    self.trace, changed = answer.trace, True
                case HeadingAnswered(generation=self._generation) if self._asking:
                    self.answer, self.trace, changed = answer.prediction, answer.trace, True
                case BScans():
                    self._drawing = False
                    changed = self._accept_bscan(answer) or changed
        return changed

    def close(self) -> None:
        """End the threads."""
        self._tracer.close()
        self._drawer.close()

    @property
    def _asking(self) -> bool:
        return self._shown is not None and self._shown.asked is not None

    def _request_trace(self, shown: Shown) -> None:
        if shown.asked is not None:
            self._request_answer(shown, shown.asked)
            return
        self.answer = None
        reading, row = shown.chosen_reading, shown.chosen_row
        if reading is None:
            self.trace, self._requested_trace = None, ()
            return
        prediction, index = (shown.prediction, row.index) if row is not None else (None, 0)
        subject = (shown.scene, reading, prediction, index)
        now = time.monotonic()
        if not _same(subject, self._requested_trace) and now - self._requested_at >= _PAUSE:
            self._requested_trace, self._requested_at = subject, now
            self._tracer.submit(TraceRequest(self._generation, shown.scene, reading, prediction, index))

    def _request_answer(self, shown: Shown, heading: float) -> None:
        outline, now = shown.outline, time.monotonic()
        if outline is None or _is_of_another_scene(outline, shown.scene):
            return
        subject = (shown.scene, outline, heading)
        if not _same(subject, self._requested_trace) and now - self._requested_at >= _PAUSE:
            self._requested_trace, self._requested_at = subject, now
            self._tracer.submit(HeadingAsked(self._generation, shown.scene, outline, heading))

    def _request_bscan(self) -> None:
        shown, settings = self._shown, self._settings
        if shown is None or settings is None or self._drawing:
            return
        subject = (shown.scene, shown.readings, shown.outline, settings, shown.look.palette)
        if not _same(subject, self._requested_bscan):
            self._requested_bscan, self._drawing = subject, True
            self._drawer.submit(BScanRequest(self._generation, *subject, self.bscan.rows if self.bscan else None))

    def _accept_bscan(self, bscan: BScans) -> bool:
        if bscan.generation != self._generation:
            self._request_bscan()
            return False
        if bscan.rows.unreadable and (self.bscan is None or bscan.rows.unreadable != self.bscan.rows.unreadable):
            self.failures.append(bscan.rows.unreadable)
        self.bscan = bscan
        if bscan.rows.done < 1:
            self._requested_bscan = ()
        self._request_bscan()  # the remaining rows, or a newer request
        return True


def _is_of_another_scene(outline: PredictedScan, scene: Scene) -> bool:
    """Return whether an outline is of a previous scene, and its paths must not be used for this one."""
    if not paths_serve_all_headings(scene.board, scene.options.unit):
        return False  # its paths are not used
    return outline.room is not scene.room or outline.place != scene.pose or outline.board is not scene.board


def _same(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))
