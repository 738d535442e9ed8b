"""When a device's time was on the host's clock: a straight line through what frames tell, kept over resets.

Takes the device time in a frame with the host's time at its arrival; hands on the device's time as it goes on over
resets, and the host's time for it. A frame arrives late or very late but never early, so of each second only the
least late one counts, and through these goes a line by least squares: offset and drift.
"""

from collections import deque

import numpy as np

from sonarhw.wire.units import seconds_of

_BUCKET = 1.0  # s
_BUCKETS = 60  # what a line goes through; a minute shows a drift of 1 in 10⁵ under 0.5 ms of jitter
_FEWEST = 5  # buckets; before that the clocks are taken to run alike
MOST_DRIFT = 0.02  # a ceramic resonator is good to 0.005; a device that is played faster or slower has this
_RAN_BACK = 1.0  # s; frames come in order, so more than this is a reset

_Sample = tuple[float, float]  # device, host


class DeviceClock:
    """The clock of one device, as its host sees it. Times in s."""

    def __init__(self) -> None:
        self.resets = 0
        self.drift = 0.0  # s the host's clock gains in each of the device's
        self._boot = 0
        self._restarted = False
        self._before = 0.0  # what the device's clock had come to before its last reset
        self._newest = 0.0  # continued device time
        self._best: deque[_Sample] = deque(maxlen=_BUCKETS)
        self._centre = (0.0, 0.0)

    @property
    def known(self) -> bool:
        """Whether anything has been heard."""
        return bool(self._best)

    def greeted(self, boot: int) -> None:
        """The device has said how often it has started; 0: it does not count."""
        self._restarted = bool(boot and self._boot and boot != self._boot)
        self._boot = boot

    def heard(self, device_us: int, arrived: float) -> None:
        """A frame of that device time has come at `arrived` on the host's clock."""
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
        """Device time as if it had never been reset, s."""
        return self._before + seconds_of(device_us)

    def host_time(self, continued: float) -> float | None:
        """The host's time at a continued device time; None before anything was heard."""
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
