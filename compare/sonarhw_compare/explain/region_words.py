"""Text about regions of constant depth: their counts, and the path of a predicted region."""

from sonarhw.errors import counted
from sonarhw_compare.explain.sentences import describe_path
from sonarhw_compare.matching.match import Comparison
from sonarhw_compare.matching.region_match import RegionMatch
from sonarhw_compare.matching.regions import Region


def region_counts(found: RegionMatch) -> str:
    """Return the counts: `7 in both, 1 more part of these, 0 only in the scan, 2 only predicted`."""
    count = len(found.parts)
    parts = f", {counted(count, 'more part')} of these" if count else ""
    return (
        f"{len(found.pairs)} in both{parts}, {len(found.only_measured)} only in the scan, "
        f"{len(found.only_predicted)} only predicted"
    )


def path_suffix(comparison: Comparison, region: Region) -> str:
    """Return the path of a predicted region, `: one reflection, top`; empty if the prediction is noise."""
    path = int(comparison.prediction.winners[region.rows[len(region) // 2]])
    return "" if path < 0 else f": {describe_path(comparison.prediction, path)}"
