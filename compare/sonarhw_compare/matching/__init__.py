"""Match measured readings with predicted ones, and group them into regions of constant depth."""
