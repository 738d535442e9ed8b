"""Names of rooms and places as text in a picture. matplotlib interprets text between dollar signs as a formula."""

from sonarhw.errors import harmless, shortened

_MOST = 100  # characters, so that the plot is not squeezed


def picture_text(name: str) -> str:
    """Return a name as matplotlib must get it to draw it as it is; of a long name the begin and the end."""
    return shortened(harmless(name), _MOST).replace("$", r"\$")
