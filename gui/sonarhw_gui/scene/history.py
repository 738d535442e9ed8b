"""The undo history: labelled scenes and notes, one step for each gesture."""

from dataclasses import dataclass

from sonarhw_gui.scene.note_texts import NoteTexts
from sonarhw_gui.scene.scene import Scene

Edited = Scene | NoteTexts
_MOST_STEPS = 200


@dataclass(frozen=True)
class EditStep:
    """Scene or notes before an edit, or after an edit that was undone, with the label of the edit."""

    state: Edited
    label: str
    gesture: object = None  # edits of one gesture are one step


class History:
    """The scenes and notes before the current ones, and those that were undone."""

    def __init__(self) -> None:
        self._done: list[EditStep] = []
        self._undone: list[EditStep] = []
        self._discarded: list[EditStep] = []  # steps that could be redone before the last edit

    @property
    def undo_label(self) -> str:
        """The label of the edit that undo reverts; empty if there is none."""
        return self._done[-1].label if self._done else ""

    @property
    def steps(self) -> tuple[str, ...]:
        """The labels of all edits that can be undone, newest first."""
        return tuple(step.label for step in reversed(self._done))

    @property
    def redo_label(self) -> str:
        """The label of the edit that redo repeats; empty if there is none."""
        return self._undone[-1].label if self._undone else ""

    def remember(self, before: Edited, label: str, gesture: object = None) -> None:
        """Store `before`, which is about to be changed."""
        if self._is_last(gesture):
            return
        self._discarded, self._undone = self._undone, []
        self._done.append(EditStep(before, label, gesture))
        del self._done[:-_MOST_STEPS]

    def cancel(self, gesture: object) -> Edited | None:
        """Remove an unfinished gesture from the history and return the state before it; None if it changed nothing."""
        if not self._is_last(gesture):
            return None
        self._discarded, self._undone = [], self._discarded
        return self._done.pop().state

    def undo(self, *now: Edited) -> Edited | None:
        """Return the state before the last step; None if there is none. `now`: the scene, and the notes."""
        return _moved(self._done, self._undone, now)

    def redo(self, *now: Edited) -> Edited | None:
        """Return the state after the step that was undone last; None if there is none."""
        return _moved(self._undone, self._done, now)

    def forget_notes(self) -> None:
        """Remove the steps of notes: their readings are no longer shown."""
        for steps in (self._done, self._undone):
            steps[:] = [step for step in steps if not isinstance(step.state, NoteTexts)]

    def clear(self) -> None:
        """Remove all steps."""
        self._done.clear()
        self._undone.clear()

    def _is_last(self, gesture: object) -> bool:
        return gesture is not None and bool(self._done) and self._done[-1].gesture is gesture


def _moved(source: list[EditStep], target: list[EditStep], now: tuple[Edited, ...]) -> Edited | None:
    if not source:
        return None
    step = source.pop()
    same_kind = next(one for one in now if isinstance(one, type(step.state)))
    target.append(EditStep(same_kind, step.label))
    return step.state
