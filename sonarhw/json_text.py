"""JSON of the figures that commands and the window write. Every JSON parser accepts it."""

import json
import math


def json_text(figures: object) -> str:
    """Return figures as indented JSON. Infinity and NaN, which JSON does not have, become null."""
    return json.dumps(_finite(figures), indent=2, allow_nan=False)


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
