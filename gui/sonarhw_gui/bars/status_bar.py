"""The status bar: activity, recording file, number and rate of readings, lost readings, temperature, live or replay."""

from pathlib import Path

from PySide6.QtCore import Qt, Slot
from PySide6.QtWidgets import QProgressBar, QStatusBar

from sonarhw_gui.live.window_status import Badge, Source, Status
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import LIGHT
from sonarhw_gui.parts.elided import ElidedLabel
from sonarhw_gui.parts.label_slot import LabelSlot
from sonarhw_gui.parts.plain_label import PlainLabel

# badges have the same background in both palettes
_COLOURS = {Badge.LIVE: LIGHT.live, Badge.REPLAY: LIGHT.replay}

FAKE = "fake scanner, hides a post"
_FAKE_MEANS = (
    "A fake scanner simulates its room, which deliberately differs from the room file: one additional post, a sensor "
    "some millimetres away, and air of another temperature. View > Causes searches for the post"
)
_FAKE_STAYS = (
    "Moving the sensor or choosing a board in the window changes the prediction only. The fake scanner is still {}, so "
    "its readings differ. Scan > Move the fake scanner here moves it, and scans again"
)
_FEW = 360  # readings; so many are compared within a moment, as during a scan
_MESSAGE_TIME = 10_000  # ms


class StatusBar(QStatusBar):
    """The line at the bottom of the window."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizeGripEnabled(False)
        self.activity = ElidedLabel()
        self.activity.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.fake = PlainLabel(FAKE)
        self.badge = PlainLabel()
        self.figures = PlainLabel()
        self.figures.setToolTip("Readings shown · readings per second · readings lost on the link · air temperature")
        # width of the longest text; otherwise an additional digit is cut off until the next layout
        widest = self.figures.fontMetrics().horizontalAdvance("00000 readings · 000.0 Hz · 0000 lost · -00.0 °C")
        self.figures.setMinimumWidth(widest)
        self.figures.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.progress = QProgressBar()
        self.progress.setFixedWidth(self.progress.fontMetrics().horizontalAdvance("000 of at most 000 parts") + 16)
        self.progress.setFormat("%v of at most %m parts")
        self.progress.setToolTip("Parts of the model that are compiled; this prediction may not need all of them")
        self.setContentsMargins(8, 0, 4, 0)
        self.addWidget(self.progress)
        self.addWidget(LabelSlot(self.activity), 1)
        self.addPermanentWidget(self.fake)
        self.addPermanentWidget(LabelSlot(self.figures))
        self.addPermanentWidget(self.badge)
        self.show_state(Status())

    @Slot(str)
    def show_briefly(self, message: str) -> None:
        """Show a message for 10 s."""
        self.showMessage(message, _MESSAGE_TIME)

    def show_look(self, look: Look) -> None:
        """Set the text colour; with a style sheet, Qt would keep the colour of the previous palette."""
        ink = look.palette.ink
        self.setStyleSheet(f"QStatusBar::item {{ border: none; }} QLabel {{ color: {ink}; }}")

    def show_state(self, status: Status) -> None:
        """Show the status."""
        self.activity.setText(activity_text(status))
        self.progress.setVisible(status.preparing is not None)
        if status.preparing is not None:
            self.progress.setRange(0, status.preparing.known)
            self.progress.setValue(status.preparing.done)
        self.fake.setVisible(status.fake)
        self.fake.setText(f"fake scanner, still {status.fake_still}" if status.fake_still else FAKE)
        self.fake.setToolTip(_FAKE_STAYS.format(status.fake_still) if status.fake_still else _FAKE_MEANS)
        self.figures.setText(figures_text(status))
        self.badge.setText(badge_text(status))
        background = _COLOURS.get(status.badge, LIGHT.idle)
        style = f"color: white; background: {background}; border-radius: 4px; padding: 1px 8px; margin: 2px;"
        if self.badge.styleSheet() != style:  # setting a style sheet triggers a new layout of the window
            self.badge.setStyleSheet(style)


def badge_text(status: Status) -> str:
    """Return the text of the badge."""
    return f"● {status.badge}" if status.badge is Badge.LIVE else str(status.badge)


def figures_text(status: Status) -> str:
    """Return the numbers of readings, their rate, and the temperature."""
    rate = [f"{status.rate:.1f} Hz"] if status.rate else []  # no rate without new readings
    parts = [f"{status.readings} readings", *rate, f"{status.lost} lost"]
    if status.temperature_c is not None:
        parts.append(f"{status.temperature_c:.1f} °C")
    return " · ".join(parts)


def activity_text(status: Status) -> str:
    """Return the current activity."""
    parts = []
    if status.source is Source.LIVE and status.phase is not None:
        parts.append("waiting for the scanner" if status.trouble else str(status.phase))
    if status.source is Source.LIVE and status.recording is not None:
        parts.append(f"{'recording to' if status.scanning else 'recorded in'} {_short(status.recording)}")
    if status.source is Source.REPLAY:
        parts.append(f"{'following' if status.following else 'replaying'} {status.log_name}")
    if status.preparing:
        parts.append("preparing the model (first start only)")
    if status.scan_due:
        parts.append("the scan begins when its prediction is there")
    if status.outdated:
        parts.append("predicting … grey values belong to the previous prediction")
    elif status.predicting and not status.preparing:
        parts.append("predicting …")
    if status.uncompared > _FEW:
        parts.append(f"{status.uncompared} readings to compare")
    return " · ".join(parts)


def _short(path: Path) -> str:
    """Return a path with the home folder as ~."""
    home = Path.home()
    return f"~/{path.relative_to(home).as_posix()}" if path.is_relative_to(home) else str(path)
