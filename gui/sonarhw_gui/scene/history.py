"""The undo history of the scene: labelled scenes, one step a gesture."""

from dataclasses import dataclass

from sonarhw_gui.scene.scene import Scene

_MOST_STEPS = 200


@dataclass(frozen=True)
class EditStep:
    """A scene, and what was done to it or undone to get at it."""

    scene: Scene
    label: str
    gesture: object = None  # steps of one gesture are one step


class History:
    """Scenes before this one, and scenes that were undone."""

    def __init__(self) -> None:
        self._done: list[EditStep] = []
        self._undone: list[EditStep] = []
        self._given_up: list[EditStep] = []  # what could have been done again before the last step

    @property
    def undo_label(self) -> str:
        """What undo would undo; empty where there is nothing."""
        return self._done[-1].label if self._done else ""

    @property
    def redo_label(self) -> str:
        """What redo would do again; empty where there is nothing."""
        return self._undone[-1].label if self._undone else ""

    def remember(self, before: Scene, label: str, gesture: object = None) -> None:
        """`before` is about to be changed."""
        if self._is_last(gesture):
            return
        self._given_up, self._undone = self._undone, []
        self._done.append(EditStep(before, label, gesture))
        del self._done[:-_MOST_STEPS]

    def cancel(self, gesture: object) -> Scene | None:
        """The scene before a gesture that is still going on, as though it had not been; None where it did nothing."""
        if not self._is_last(gesture):
            return None
        self._given_up, self._undone = [], self._given_up
        return self._done.pop().scene

    def undo(self, now: Scene) -> Scene | None:
        """The scene before the last step; None where there is none."""
        return _moved(self._done, self._undone, now)

    def redo(self, now: Scene) -> Scene | None:
        """The scene after the step that was undone last; None where there is none."""
        return _moved(self._undone, self._done, now)

    def forget(self) -> None:
        """Begin anew."""
        self._done.clear()
        self._undone.clear()

    def _is_last(self, gesture: object) -> bool:
        return gesture is not None and bool(self._done) and self._done[-1].gesture is gesture


def _moved(source: list[EditStep], target: list[EditStep], now: Scene) -> Scene | None:
    if not source:
        return None
    step = source.pop()
    target.append(EditStep(now, step.label))
    return step.scene
