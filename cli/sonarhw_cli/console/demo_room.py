"""The demo: a shipped room, a place in it, and the URL of the fake scanner there."""

ROOM = "laboratory"
PLACE = "bench"
_SEED = 1


def demo_url(pace: str = "real") -> str:
    """Return the URL of the fake scanner in the demo room."""
    return f"fake:{ROOM}?place={PLACE}&seed={_SEED}&pace={pace}"
