"""The connections between the session and the commands, panels and bars of the window."""

from sonarhw_gui.bars.banner import Banner
from sonarhw_gui.causes.causes_panel import CausesPanel
from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.finding.find_panel import FindPanel
from sonarhw_gui.fitting.fit_panel import FitPanel
from sonarhw_gui.panels.device_panel import DevicePanel
from sonarhw_gui.panels.replay_bar import ReplayBar
from sonarhw_gui.scans.scans_panel import ScansPanel
from sonarhw_gui.session.window_session import WindowSession
from sonarhw_gui.sound.sound_bar import SoundBar


def connect_commands(commands: Commands, session: WindowSession) -> None:
    """Connect each command with its action in the session."""
    showing, replay = session.showing, session.replay
    for action, slot in (
        (commands.scan, session.scan),
        (commands.stop, session.stop),
        (commands.home, session.live.home),
        (commands.move_fake, session.move_fake),
        (commands.undo, showing.undo),
        (commands.redo, showing.redo),
        (commands.previous, showing.choose_previous),
        (commands.next, showing.choose_next),
        (commands.newest, showing.follow_newest),
        (commands.sound, session.play_sound),
        (commands.play, replay.toggle),
        (commands.back, replay.step_back),
        (commands.forward, replay.step_forward),
        (commands.previous_scan, replay.previous_scan),
        (commands.next_scan, replay.next_scan),
        (commands.loop, replay.set_loop),
        (commands.skip_gaps, replay.set_skip_gaps),
        (commands.leave_replay, session.leave_replay),
    ):
        action.triggered.connect(slot)


def connect_device(panel: DevicePanel, session: WindowSession) -> None:
    """Connect the device panel with the scanner."""
    panel.connect_requested.connect(session.live.connect)
    panel.disconnect_requested.connect(session.live.disconnect)
    panel.turn_requested.connect(session.live.turn)
    panel.settings_changed.connect(session.live.set_scan_settings)


def connect_fit(panel: FitPanel, session: WindowSession) -> None:
    """Connect the fit panel with the fits of the session."""
    panel.edited.connect(session.showing.edit)
    panel.requested.connect(session.fitting.start)
    panel.cancelled.connect(session.fitting.cancel)
    session.fitting.changed.connect(panel.show_fit)


def connect_causes(panel: CausesPanel, session: WindowSession) -> None:
    """Connect the panel of causes with the search of the session."""
    panel.requested.connect(session.causes.start)
    panel.cancelled.connect(session.causes.cancel)
    panel.edited.connect(session.showing.edit)
    panel.undone.connect(session.showing.undo)
    panel.proposed.connect(session.showing.propose)
    panel.picked.connect(session.showing.choose)
    session.causes.changed.connect(panel.show_causes)


def connect_scans(panel: ScansPanel, session: WindowSession) -> None:
    """Connect the panel of scans with their list."""
    panel.kept.connect(session.scans.keep)
    panel.sweeps_kept.connect(session.scans.keep_sweeps)
    panel.removed.connect(session.scans.remove)
    panel.switched.connect(session.scans.switch)
    panel.pair_chosen.connect(session.scans.compare)
    session.scans.changed.connect(panel.show_scans)


def connect_finding(panel: FindPanel, session: WindowSession) -> None:
    """Connect the panel "Find the room" with the search of the session."""
    finding, showing = session.finding, session.showing
    panel.requested.connect(finding.start)
    panel.continued.connect(finding.go_on)
    panel.cancelled.connect(finding.cancel)
    panel.rejected.connect(finding.reject)
    panel.accepted.connect(finding.note_accepted)
    panel.next_requested.connect(finding.plan_next)
    panel.edited.connect(showing.edit)
    panel.drawn.connect(showing.draw_found)
    finding.changed.connect(panel.show_search)


def connect_replay(bar: ReplayBar, session: WindowSession) -> None:
    """Connect the replay bar with the replay."""
    bar.toggled.connect(session.replay.toggle)
    bar.sought.connect(session.replay.seek)
    bar.speed_chosen.connect(session.replay.set_speed)
    session.replay.changed.connect(bar.show_state)
    bar.show_state(session.replay.state)


def connect_sound(bar: SoundBar, session: WindowSession) -> None:
    """Connect the sound bar with the playback."""
    sound = session.sound
    bar.toggled.connect(sound.toggle)
    bar.sought.connect(sound.seek)
    bar.slowness_chosen.connect(sound.set_slowness)
    bar.loop_changed.connect(sound.set_loop)
    bar.every_changed.connect(sound.set_every)
    bar.closed.connect(sound.close)
    sound.changed.connect(bar.show_state)


def connect_banner(banner: Banner, session: WindowSession) -> None:
    """Connect the banner with errors, warnings and offers of the session."""
    session.warned.connect(banner.show_message)
    session.failed.connect(banner.show_error)
    for part in (session.fitting, session.causes, session.scans, session.saver):
        part.failed.connect(banner.show_error)
    session.finding.failed.connect(banner.show_search_error)
    session.finding.settled.connect(banner.end_search_errors)
    session.scanners.failed.connect(banner.show_connection_error)
    session.connected.connect(banner.end_connection_errors)
    session.noticed.connect(banner.show_notice)
    banner.answered.connect(session.answer_offer)
