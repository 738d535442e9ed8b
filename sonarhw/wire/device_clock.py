"""Conversion of device time to host time, by a straight line that is fitted to the arrival times of frames.

Frames arrive with a varying delay, never early. So the fit uses only the frame with the least delay in each second. A
least-squares line through these frames gives offset and drift. Device time continues across resets of the device.
"""

from collections import deque

import numpy as np

from sonarhw.wire.units import seconds_of

_BUCKET = 1.0  # s
_BUCKETS = 60  # in the fit; one minute is enough to measure a drift of 10⁻⁵ with 0.5 ms of jitter
_FEWEST = 5  # with fewer buckets, a drift of 0 is assumed
MOST_DRIFT = 0.02  # limit of the fitted drift; that of a ceramic resonator is below 0.005
_RAN_BACK = 1.0  # s; frames arrive in order, so a larger step back is a reset

_Sample = tuple[float, float]  # device, host


class DeviceClock:
    """The clock of one device relative to the host's clock. Times in s."""

    def __init__(self) -> None:
        self.resets = 0
        self.drift = 0.0  # s that the host's clock gains per second of device time
        self._boot = 0
        self._restarted = False
        self._before = 0.0  # s added to device time, so that it continues across resets
        self._newest = 0.0  # continued device time of the newest frame, s
        self._best: deque[_Sample] = deque(maxlen=_BUCKETS)
        self._centre = (0.0, 0.0)

    @property
    def known(self) -> bool:
        """Whether any frame has been added."""
        return bool(self._best)

    def set_boot(self, boot: int) -> None:
        """Set the boot count from Info; a changed count means a reset. 0: the device does not count."""
        self._restarted = bool(boot and self._boot and boot != self._boot)
        self._boot = boot

    def add_frame(self, device_us: int, arrived: float) -> None:
        """Add a frame with device time `device_us` that arrived at host time `arrived`."""
        device = seconds_of(device_us)
        if self._restarted or (self.known and self._before + device < self._newest - _RAN_BACK):
            self._restart(device, arrived)
        device += self._before
        self._newest = max(self._newest, device)
        if self._best and device < self._best[-1][0] // _BUCKET * _BUCKET + _BUCKET:
            if arrived - device < self._best[-1][1] - self._best[-1][0]:
                self._best[-1] = (device, arrived)
                self._fit()
        else:
            self._best.append((device, arrived))
            self._fit()

    def continued(self, device_us: int) -> float:
        """Return the device time as if the device had never been reset, s."""
        return self._before + seconds_of(device_us)

    def host_time(self, continued: float) -> float | None:
        """Return the host time at a continued device time, or None before the first frame."""
        device, host = self._centre
        return host + (continued - device) * (1 + self.drift) if self.known else None

    def _restart(self, device: float, arrived: float) -> None:
        self.resets += 1
        self._restarted = False
        centre, host = self._centre
        now = centre + (arrived - host) / (1 + self.drift)
        self._before = max(now, self._newest) - device
        self._newest = self._before + device

    def _fit(self) -> None:
        device, host = np.array(self._best, dtype=np.float64).T
        late = host - device
        if len(self._best) < _FEWEST:
            least = int(np.argmin(late))
            self._centre = (float(device[least]), float(host[least]))
            return
        middle = device - device.mean()
        slope = float(middle @ (late - late.mean()) / (middle @ middle))
        self.drift = min(max(slope, -MOST_DRIFT), MOST_DRIFT)
        self._centre = (float(device.mean()), float(host.mean()))
