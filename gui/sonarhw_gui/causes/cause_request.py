"""The search for causes as a request to a thread."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sonarhw.readings import Reading
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import room_and_place
from sonarhw_gui.work.run_progress import RunProgress

if TYPE_CHECKING:
    from sonarhw_compare.causes.cause_search import FoundCauses


@dataclass(frozen=True, eq=False)
class CausesAnswer:
    """The result of a search."""

    request: "CauseRequest"
    found: "FoundCauses"


@dataclass(frozen=True)
class CauseRequest:
    """Search for the causes of misfits."""

    scene: Scene
    readings: tuple[Reading, ...]
    first: int  # number of the first of them among the readings shown
    progress: RunProgress = field(compare=False)

    def answer(self) -> CausesAnswer:
        """Run the search, which takes about ten seconds. Raises InputError."""
        from sonarhw_compare.causes.cause_search import find_causes  # takes half a second

        room, place = room_and_place(self.scene)
        progress = self.progress
        found = find_causes(
            self.readings,
            room,
            place,
            self.scene.board,
            tick=lambda share: progress.report(share, "searching"),
            cancelled=lambda: progress.cancelled,
        )
        return CausesAnswer(self, found)
