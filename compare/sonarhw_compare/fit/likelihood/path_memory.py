"""The last searches of paths of a fit: several steps of a fit begin where the one before has ended."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from sonarhw_sim.room.model import Room

from sonarhw_compare.fit.likelihood.echo_paths import EchoPaths

_KEPT = 4  # searches


@dataclass(frozen=True)
class PathMemory:
    """Paths by the room and by all else that they depend on."""

    _searches: deque[tuple[Room, object, tuple[EchoPaths, ...]]] = field(default_factory=lambda: deque(maxlen=_KEPT))

    def paths(self, room: Room, key: object, search: Callable[[], tuple[EchoPaths, ...]]) -> tuple[EchoPaths, ...]:
        """Return the paths of an earlier search in this very room with an equal key, or else those of `search`."""
        for there, its_key, found in tuple(self._searches):
            if there is room and its_key == key:
                return found
        found = search()
        self._searches.append((room, key, found))
        return found
