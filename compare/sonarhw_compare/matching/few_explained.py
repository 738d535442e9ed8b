"""The warning that a prediction explains few echoes of a scan, one for `compare`, `report`, `fit` and `locate`."""

FEWEST = 0.6  # of the echoes; nine real scans have at least 76 % within 5 cm in the right room


def explains_few(share: float | None) -> bool:
    """Return whether a share of echoes within 5 cm of the prediction is too small; not if it is unknown."""
    return share is not None and share < FEWEST


def few_explained(scan: str, share: float | None, echoes: int, *, located: bool = False) -> tuple[str, ...]:
    """Return a warning if only a small share of `echoes` is within 5 cm of the prediction.

    `located`: the place was searched in the whole room, so it is not the cause.
    """
    if share is None or not explains_few(share):
        return ()
    return (few_explained_line(scan, share, echoes, located=located),)


def few_explained_line(scan: str, share: float, echoes: int, *, located: bool = False) -> str:
    """Return the warning of `few_explained` for a `share` that is too small."""
    found = f"{scan}: only {share:.0%} of {echoes} echoes are within 5 cm of the prediction"
    if located:
        return f"{found}; check the room and the board"
    return f"{found}; check the room, the place and the board; `sonarhw locate` finds an unknown place"
