"""Regions of constant depth in words: how many were found in which scan, and what a predicted one is heard from.

Takes a comparison and its regions; hands on text.
"""

from sonarhw_compare.explain.sentences import describe_path
from sonarhw_compare.matching.match import Comparison
from sonarhw_compare.matching.region_match import RegionMatch
from sonarhw_compare.matching.regions import Region


def how_many(found: RegionMatch) -> str:
    """So many in both scans, and in one only: `7 in both, 1 more part of these, 0 only measured, 2 only predicted`."""
    count = len(found.parts)
    parts = f", {count} more part{'s' if count > 1 else ''} of these" if count else ""
    return (
        f"{len(found.pairs)} in both{parts}, {len(found.only_measured)} only measured, "
        f"{len(found.only_predicted)} only predicted"
    )


def heard_from(comparison: Comparison, region: Region) -> str:
    """The path by which a predicted region is heard, `: one reflection, top`; nothing where noise is what is heard."""
    path = int(comparison.prediction.winners[region.rows[len(region) // 2]])
    return "" if path < 0 else f": {describe_path(comparison.prediction, path)}"
