"""A device that prints text on a serial line, as a plug-in: `lines:/dev/ttyUSB0?baud=9600&preset=arduino-radar`."""

import math
from collections.abc import Mapping

from sonarhw.link.ports import PortFinder
from sonarhw.link.serial_link import READ_PATIENCE, Link
from sonarhw.plugins.device_plugin import DeviceIdentity, DevicePlugin, Measurement
from sonarhw.readings import ScanOrder
from sonarhw.text.line_decoder import DecodedLine, LineDecoder
from sonarhw.text.lines_url import read_lines_url
from sonarhw.text.presets import PRESETS


class TextDevice(DevicePlugin):
    """Reads lines of text, and decodes angle and range in each."""

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self._settings = read_lines_url(url)
        self._find = PortFinder(self._settings.port)
        self._decoder = LineDecoder(self._settings.make_format())
        self._link: Link | None = None
        self._steps = 0  # readings since the scan began, of a device that prints no angle
        self._bytes = 0

    @property
    def identity(self) -> DeviceIdentity:
        """The format, because the device does not identify itself."""
        return DeviceIdentity(f"text lines, {self._settings.preset or 'pattern'}", board=self._settings.board)

    def open(self) -> None:
        """Open the port."""
        self._link = Link(self._find())
        self._link.set_baud(self._settings.baud)
        self._decoder.lost()

    def read(self) -> list[Measurement]:
        """Return the readings of the lines that have arrived."""
        data = self._link.read() if self._link else b""
        if not data:
            self._decoder.idle(READ_PATIENCE)
            return []
        self._bytes += len(data)
        self.on_bytes(data)
        return [self._measurement(line) for line in self._decoder.feed(data)]

    def close(self) -> None:
        """Close the port."""
        link, self._link = self._link, None
        if link:
            link.close()

    def begin(self, order: ScanOrder) -> bool:
        """Count the steps of a device that prints no angle from here.

        Returns whether earlier measurements may belong to the scan; their angle is known only if it is printed.
        """
        self._steps = 0
        return self._settings.step is None

    @property
    def ignored(self) -> Mapping[str, int]:
        """The lines that were no readings."""
        ignored = self._decoder.ignored
        return {"half lines": ignored.half_lines, "lines of other text": ignored.other_lines, "noise": ignored.noise}

    @property
    def diagnosis(self) -> str:
        """What arrived instead of readings."""
        ignored, settings = self._decoder.ignored, self._settings
        if not self._bytes:
            return "nothing was received; check the cable, and that the sketch prints without a command"
        if ignored.noise > ignored.half_lines + ignored.other_lines:
            return f"{self._bytes} bytes were received, mostly not text; the baud rate may not be {settings.baud}"
        example = f", such as {self._decoder.example!r}" if self._decoder.example else ""
        wanted = PRESETS[settings.preset].example if settings.preset else settings.pattern
        return (
            f"{self._bytes} bytes were received, {ignored.total} lines are no readings{example}; expected {wanted!r}; "
            "`sonarhw ports --guess` proposes a preset"
        )

    def _measurement(self, line: DecodedLine) -> Measurement:
        heading, distance = line.printed.heading, line.printed.range
        if heading is None:
            heading = math.degrees(self._steps * (self._settings.step or 0.0)) % 360
            self._steps += 1
        angle = self._settings.turntable_angle(heading)
        return Measurement(angle, () if distance is None else (distance,), restarted=line.restarted)
