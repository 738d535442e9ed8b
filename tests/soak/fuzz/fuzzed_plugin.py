"""Plug-ins that return and raise what the number in their URL decides, such as `fuzzed:7`."""

import math
import sys
import time
from decimal import Decimal
from pathlib import Path
from typing import Any

from sonarhw.errors import InputError, LinkLost, NoAnswer
from sonarhw.plugins.device_plugin import DeviceIdentity, DevicePlugin, Measurement
from sonarhw.readings import ScanOrder
from tests.soak.fuzz.boundaries import Chance

SCHEMES = {"fuzzed": "Fuzzed", "ordered": "Ordered"}
_ERRORS: tuple[type[BaseException] | BaseException, ...] = (
    *(ValueError, OSError(5, "gone"), KeyboardInterrupt, SystemExit(3), MemoryError, StopIteration, GeneratorExit),
    *(RecursionError, AssertionError, UnicodeError("\udcff"), Exception("\x1b[2J\nsecond line"), Exception("x" * 5000)),
    *(LinkLost("the cable is out"), NoAnswer("no answer"), InputError("not this one")),
)
_ODD: tuple[Any, ...] = (
    *(math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-308, -1.0, 0, True, None, "1", "x", b"1", 1j, 10**400),
    *(Decimal("NaN"), Decimal("1e999"), [1.0], (), {}, object(), "\x1b[2J\udcff" * 100),
)


def install(folder: Path) -> None:
    """Make the plug-ins known to this process, as a package in `folder`."""
    metadata = folder / "fuzzed-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: fuzzed\nVersion: 1.0\n")
    points = "".join(f"{scheme} = {__name__}:{name}\n" for scheme, name in SCHEMES.items())
    (metadata / "entry_points.txt").write_text(f"[sonarhw.devices]\n{points}")
    sys.path.insert(0, str(folder))


class Fuzzed(DevicePlugin):
    """Turns by itself."""

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self._chance = Chance(int(url.partition(":")[2]))
        self._reads = 0
        self._answer(None)

    def _answer(self, usual: Any, share: float = 0.02) -> Any:
        """Return `usual`, or something else, or raise an error."""
        if not self._chance.hostile(share):
            return usual
        if self._chance.random() < 0.5:
            raise self._chance.choice(_ERRORS)
        return self._chance.choice(_ODD)

    @property
    def identity(self) -> DeviceIdentity:
        """A name."""
        return self._answer(DeviceIdentity(*(self._answer(text, 0.1) for text in ("fuzzed", "1", "paper"))))

    def open(self) -> None:
        """Open nothing."""
        self._answer(None, 0.1)

    def read(self) -> list[Measurement]:
        """Return one to three measurements."""
        time.sleep(0.0005)
        self.on_bytes(self._answer(b"reading\n"))
        return self._answer([self._answer(self._measured()) for _ in range(self._chance.randrange(1, 4))])

    def _measured(self) -> Measurement:
        self._reads += 1
        angle = math.radians(abs(self._reads % 24 - 12) * 5)
        ranges = self._answer(tuple(self._answer(1.0 + number) for number in range(self._chance.randrange(3))))
        return Measurement(
            self._answer(angle), ranges, self._answer(None), self._answer(20.0), self._answer(False, 0.01)
        )

    def close(self) -> None:
        """Close nothing."""
        self._answer(None, 0.1)

    def begin(self, order: ScanOrder) -> bool:
        """Begin."""
        return self._answer(True, 0.1)

    def end(self) -> None:
        """End."""
        self._answer(None, 0.1)

    @property
    def ignored(self) -> dict[str, int]:
        """Odd counts."""
        return self._answer({"noise": self._answer(1, 0.1)}, 0.1)

    @property
    def notes(self) -> tuple[str, ...]:
        """Odd notes."""
        return self._answer((self._answer("the unit is assumed", 0.1),), 0.1)

    @property
    def diagnosis(self) -> str:
        """An odd clause."""
        return self._answer("check the cable", 0.1)


class Ordered(Fuzzed):
    """Measures at the ordered angles."""

    takes_orders = True
