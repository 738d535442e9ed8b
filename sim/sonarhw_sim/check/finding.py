"""One thing that is probably wrong in a room file."""

from dataclasses import dataclass

Point = tuple[float, float]  # m


@dataclass(frozen=True)
class Finding:
    """What is probably wrong, where, and what to do."""

    kind: str  # one word, for programs
    where: str  # names of walls, posts, places or materials
    found: str
    advice: str
    at: tuple[Point, ...] = ()  # where a drawing marks it; empty: nowhere

    @property
    def line(self) -> str:
        """The finding on one line."""
        return f"{self.where}: {self.found}; {self.advice}"
