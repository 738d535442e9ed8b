"""Publish readings while they are measured, on the WebSocket of Foxglove, with the channels of a log."""

import logging
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from types import TracebackType
from typing import Self

from sonarhw.device.served import host_and_port
from sonarhw.errors import LinkError, MissingExtra
from sonarhw.log.reader import SWEEPS, possible_time
from sonarhw.log.writer import DECODED, laser_scan, reading_messages
from sonarhw.readings import Reading

_LAST_SENT_WITHIN = 1.0  # s; the SDK drops what it has not sent when it stops, and does not report when all is sent
_STOPPED_WITHIN = 0.5  # s
PREDICTION = "/prediction"  # a LaserScan for each one of /scan, at the same headings and with the same time


class FoxgloveServer:
    """A WebSocket server for any number of viewers; a context manager.

    The SDK sends in its own threads. It drops the oldest messages of a viewer that reads too slowly.
    """

    def __init__(self, address: str) -> None:
        """Listen on HOST:PORT; port 0 selects a free one. Raises InputError, LinkError and MissingExtra."""
        try:
            import foxglove
        except ImportError as error:
            raise MissingExtra("a server for Foxglove needs its SDK", "foxglove") from error
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)  # a viewer that leaves is no error
        host, port = host_and_port(address)
        self._context = context = foxglove.Context()  # a channel closes without it
        self._channels = {
            topic: foxglove.Channel(
                topic,
                message_encoding=channel.encoding,
                schema=foxglove.Schema(name=channel.schema_name, encoding=channel.schema_encoding, data=channel.schema),
                context=context,
            )
            for topic, channel in {**DECODED, PREDICTION: DECODED[SWEEPS]}.items()
        }
        try:
            self._server = foxglove.start_server(name="sonarhw", host=host, port=port, context=context)
        except RuntimeError as error:
            reason = str(error).rpartition("Failed to bind port: ")[2].partition(" (os error")[0]
            raise LinkError(f"{address}: cannot listen there: {reason}; try 127.0.0.1:0") from error
        self.url = f"ws://{host}:{self._server.port}"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if any(channel.has_sinks() for channel in self._channels.values()):
                time.sleep(_LAST_SENT_WITHIN)
        finally:
            # the SDK waits for viewers that have connected and say nothing
            stopping = threading.Thread(target=self._server.stop, name="stop the server of Foxglove", daemon=True)
            stopping.start()
            stopping.join(_STOPPED_WITHIN)

    def reading(self, reading: Reading) -> None:
        """Publish a reading, its pose and its trace."""
        measured = time.time() if reading.host_time is None else reading.host_time
        for topic, data in reading_messages(reading, measured):
            self._channels[topic].log(data, log_time=round(possible_time(measured) * 1e9))

    def sweep(self, readings: Sequence[Reading], predicted: Sequence[float | None] | None = None) -> None:
        """Publish a sweep, and the predicted ranges of its readings (m; None: no echo) beside it."""
        times = [reading.host_time for reading in readings if reading.host_time is not None]
        began = min(times, default=time.time())
        self._scan(SWEEPS, readings, began)
        if predicted is not None:
            self._scan(PREDICTION, [_at_range(*pair) for pair in zip(readings, predicted, strict=True)], began)

    def _scan(self, topic: str, readings: Sequence[Reading], began: float) -> None:
        self._channels[topic].log(laser_scan(readings, began).SerializeToString(), log_time=time.time_ns())


def _at_range(reading: Reading, distance: float | None) -> Reading:
    """Return the reading with an echo at that range only."""
    echoes = () if distance is None else (2 * distance / reading.speed_of_sound,)
    return replace(reading, echo_times=echoes)
