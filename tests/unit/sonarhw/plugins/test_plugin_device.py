"""A plug-in answers as a device of the protocol, also after a loss of its link."""

import math

from sonarhw.plugins.device_plugin import CheckedPlugin, DeviceIdentity, DevicePlugin, Measurement
from sonarhw.plugins.plugin_device import Arrival, PluginDevice
from sonarhw.readings import ScanOrder
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import (
    Configure,
    Finished,
    Hello,
    Info,
    Message,
    ReadingMessage,
    Started,
    StartScan,
    Stop,
    unpack_message,
)

BEGAN = 1_700_000_000.0  # s since the epoch
MANY = StartScan(0, 1_000_000, 1, 60_000, 1)


class Servo(DevicePlugin):
    """A device that turns by itself."""

    identity = DeviceIdentity("servo")

    def open(self) -> None:
        """Do nothing."""

    def read(self) -> list[Measurement]:
        return []

    def close(self) -> None:
        """Do nothing."""


class Talk:
    """A host that talks to the device."""

    def __init__(self) -> None:
        self.orders: list[ScanOrder | None] = []
        self.device = PluginDevice(CheckedPlugin(Servo("servo:")), self.orders.append)
        self._sent = 0

    def send(self, message: Message, now: float) -> list[tuple[int, Message]]:
        """Send a command, and return the answers with their times, µs."""
        self._sent += 1
        self.device.receive(encode_frame(Frame(message.TYPE, self._sent, 0, message.pack())), BEGAN + now)
        return self.answers(now)

    def measure(self, degrees: int, measured: float, now: float) -> list[tuple[int, Message]]:
        """Pass a measurement to the device, and return what it sends."""
        measurement = Measurement(math.radians(degrees), (1.0,))
        self.device.take(Arrival(BEGAN + measured, b"", (measurement,)), BEGAN + now)
        return self.answers(now)

    def answers(self, now: float) -> list[tuple[int, Message]]:
        frames = [frame for frame in FrameDecoder().feed(self.device.advance(BEGAN + now)) if isinstance(frame, Frame)]
        unpacked = ((frame.time_us, unpack_message(frame.type, frame.payload)) for frame in frames)
        return [(time_us, message) for time_us, message in unpacked if message is not None]

    def greet(self, now: float) -> None:
        ((_, info),) = self.send(Hello(1, 2), now)
        assert isinstance(info, Info)
        self.send(Configure(62_500, 0, 0, 343_000), now)


def readings(sent: list[tuple[int, Message]]) -> list[ReadingMessage]:
    return [message for _, message in sent if isinstance(message, ReadingMessage)]


def test_the_number_of_readings_is_stated_at_the_end() -> None:
    talk = Talk()
    talk.greet(0.0)
    ((_, started),) = [pair for pair in talk.send(MANY, 0.1) if isinstance(pair[1], Started)]
    assert isinstance(started, Started)
    assert started.readings == 0
    made = []
    for k, degrees in enumerate([*range(0, 91, 10), *range(80, -1, -10), *range(10, 51, 10)]):
        made += readings(talk.measure(degrees, 0.2 + k / 10, 0.2 + k / 10))
    sent = talk.send(Stop(), 4.0)
    made += readings(sent)
    assert [reading.number for reading in made] == [*range(len(made))]
    again = [message for _, message in sent if isinstance(message, Started)]
    (finished,) = [message for _, message in sent if isinstance(message, Finished)]
    assert [message.readings for message in again] == [len(made)]
    assert finished.readings == len(made)
    assert talk.orders[-1] is None


def test_no_reading_of_a_continued_scan_is_older_than_its_order() -> None:
    talk = Talk()
    talk.greet(0.0)
    talk.send(MANY, 0.1)
    made = []
    for k, degrees in enumerate([*range(0, 91, 10), *range(80, 29, -10)]):
        made += readings(talk.measure(degrees, 0.2 + k / 10, 0.2 + k / 10))
    talk.device.hang_up()
    talk.greet(5.0)
    sent = talk.send(StartScan(0, 1_000_000, 1, 60_000, 1, len(made), 1000), 5.5)
    (began,) = [time_us for time_us, message in sent if isinstance(message, Started)]
    continued = []
    for degrees in (20, 10, 0, 10, 20):  # arrived before the order
        continued += readings(talk.measure(degrees, 5.2, 5.6))
    assert continued
    assert continued[0].number == len(made)
    assert all(reading.fired_us >= began for reading in continued)
    assert len(talk.orders) == 1
