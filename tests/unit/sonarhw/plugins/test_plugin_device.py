"""A plug-in answers as a device of the protocol, also after a loss of its link."""

import math
from collections.abc import Iterable

from sonarhw.plugins.device_plugin import Measurement
from sonarhw.plugins.plugin_device import Arrival, PluginDevice
from sonarhw.readings import ScanOrder
from sonarhw.wire.messages import Configure, Finished, ReadingMessage, Settings, Started, StartScan, Stop
from tests.contract.talk import DirectLine, Talk, readings
from tests.fixtures.plain_plugin import plain_plugin

BEGAN = 1_700_000_000.0  # s since the epoch
MANY = StartScan(0, 1_000_000, 1, 60_000, 1)


class Turning:
    """A conversation with a plug-in whose device measures at given angles, ten times a second."""

    def __init__(self) -> None:
        self.device: PluginDevice
        self.orders: list[ScanOrder | None]
        self.device, self.orders = plain_plugin()
        line = DirectLine(self.device)
        line.now = BEGAN
        self.talk = Talk(line, line.clock)
        self.greet()

    def greet(self) -> None:
        """Begin a conversation."""
        self.talk.greet()
        self.talk.ask(Configure(62_500, 0, 0, 343_000), Settings)

    def measure(self, degrees: Iterable[int], arrived: float | None = None) -> list[ReadingMessage]:
        """Pass measurements to the device, `arrived` at that time or now; return the readings that it sends."""
        since = len(self.talk.received)
        for angle in degrees:
            now = self.talk.clock()
            self.device.take(Arrival(arrived or now, b"", (Measurement(math.radians(angle), (2.0, 1.0)),)), now)
            self.talk.quiet(0.1)
        return readings(self.talk.messages(since))


def test_the_number_of_readings_is_stated_at_the_end() -> None:
    turning = Turning()
    assert turning.talk.ask(MANY, Started).readings == 0
    turning.measure([*range(0, 91, 10), *range(80, -1, -10), *range(10, 51, 10)])
    turning.talk.answer(Stop())
    made = readings(turning.talk.messages())
    assert [reading.number for reading in made] == [*range(len(made))]
    assert all(reading.echoes[0] < reading.echoes[1] for reading in made)  # also if a plug-in does not sort them
    ends = [(type(one), one.readings) for one in turning.talk.messages()[1:] if isinstance(one, Started | Finished)]
    assert ends[1:] == [(Started, len(made)), (Finished, len(made))]
    assert turning.orders[-1] is None


def test_no_reading_of_a_continued_scan_is_older_than_its_order() -> None:
    turning = Turning()
    turning.talk.ask(MANY, Started)
    made = turning.measure([*range(0, 91, 10), *range(80, 29, -10)])
    turning.device.hang_up()
    turning.greet()
    before = turning.talk.clock()
    turning.talk.quiet(0.5)
    since = len(turning.talk.received)
    turning.talk.ask(StartScan(0, 1_000_000, 1, 60_000, 1, len(made), 1000), Started)
    began = next(item.frame.time_us for item in turning.talk.received[since:] if isinstance(item.message, Started))
    continued = turning.measure((20, 10, 0, 10, 20), arrived=before)  # before the order
    assert continued[0].number == len(made)
    assert all(reading.fired_us >= began for reading in continued)
    assert len(turning.orders) == 1
