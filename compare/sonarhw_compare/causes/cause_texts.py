"""Causes of misfits as text."""

import math
from collections import Counter

from sonarhw_compare.causes.cause_search import MISFITS, Cause, FoundCauses
from sonarhw_compare.explain.sentences import LengthText, in_metres
from sonarhw_compare.matching.match import Comparison

_MOST_SECTORS = 3  # named in a text


def cause_text(cause: Cause, text: LengthText = in_metres) -> str:
    """Return one sentence: the readings, their headings, and the change that explains them."""
    return f"{readings_text(cause)}: {cause.change.text(text)}"


def readings_text(cause: Cause) -> str:
    """Return how many readings of which class a change explains, and their headings."""
    misfits = [(kind, count) for kind, count in cause.kinds if kind in MISFITS]
    kind, count = misfits[0] if misfits else cause.kinds[0]
    if count == len(cause.readings):
        return f"{count} {kind.label} readings at {_headings(cause)}"
    return f"{len(cause.readings)} readings ({count} {kind.label}) at {_headings(cause)}"


def _headings(cause: Cause) -> str:
    degrees = [[round(math.degrees(heading)) % 360 for heading in sector] for sector in cause.sectors]
    texts = [f"{first}–{last}°" if first != last else f"{first}°" for first, last in degrees]
    return ", ".join([*texts[:_MOST_SECTORS], *(["…"] if len(texts) > _MOST_SECTORS else [])])


def explained_text(found: FoundCauses) -> str:
    """Return the shares of echoes within 5 cm of the prediction before and after all changes."""
    return (
        f"within 5 cm of the prediction: {_share(found.before)} of the echoes, with all changes {_share(found.after)}"
    )


def left_text(found: FoundCauses) -> str:
    """Return how many misfits have no cause, by class."""
    if not found.left:
        return "no misfit is left"
    kinds = Counter(found.after.rows[row].kind.label for row in found.left)
    return f"without a cause: {', '.join(f'{count} {kind}' for kind, count in kinds.most_common())}"


def _share(comparison: Comparison) -> str:
    share = comparison.summary().within_5cm
    return "none" if share is None else f"{share:.1%}"
