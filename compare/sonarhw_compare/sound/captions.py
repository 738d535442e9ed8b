"""One line on what happens at a moment of a ping."""

from sonarhw_compare.explain.sentences import LengthText, describe_path, in_metres
from sonarhw_compare.sound.moments import PlayedPing, SoundWay

_SHOWN = 6e-4  # s for which an echo within blanking is mentioned; a film shows it for half a second


def caption_at(ping: PlayedPing, time: float, text: LengthText = in_metres) -> str:
    """Return what happens `time` s after transmission began, with the time in milliseconds."""
    return f"{time * 1e3:.2f} ms: {_event(ping, time, text)}"


def _event(ping: PlayedPing, time: float, text: LengthText) -> str:
    board = ping.prediction.board
    blanked = [way for way in ping.ways if way.echo.blanked and way.echo.time <= time < way.echo.time + _SHOWN]
    if ping.detected is not None and time >= ping.detected:
        range_ = float(ping.prediction.ranges[ping.index])
        return f"{_via(ping, ping.ways[0])} returns; the board would report {text(range_)}"
    if blanked:
        return f"the echo of {_via(ping, blanked[-1])} arrives within blanking and is not detected"
    if time < board.transmit_cycles / board.frequency:
        return "the board transmits"
    if time < ping.blanking:
        return "the board does not listen yet (blanking)"
    return "the board listens"


def _via(ping: PlayedPing, way: SoundWay) -> str:
    paths, room = ping.prediction.paths, ping.prediction.room
    if ping.prediction.winners[ping.index] < 0:
        return "noise"
    names = paths.via(way.echo.path, room)
    return ", ".join(names) if len(names) < 5 else describe_path(ping.prediction, way.echo.path).split(",")[0]
