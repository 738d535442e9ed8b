"""The nine real scans of a known room: the ray-following model explains more of them than walls and cones do."""

from pathlib import Path

import pytest

from benchmarks.real_scans import DEFAULT_FOLDER, judge, load_scans
from sim.models import Model

pytestmark = pytest.mark.skipif(not Path(DEFAULT_FOLDER).is_dir(), reason="the real scans are not here")


def test_ray_following_explains_more_than_walls_and_cones() -> None:
    scans = load_scans(DEFAULT_FOLDER)
    echoes = sum(reading.range is not None for scan in scans for reading in scan.readings)
    shares = {
        model: sum(judge(scan, model).matched for scan in scans) / echoes
        for model in (Model.NEAREST, Model.CONE, Model.RAY_FOLLOWING)
    }
    assert len(scans) == 9
    assert 0.63 < shares[Model.NEAREST] < 0.70
    assert 0.66 < shares[Model.CONE] < 0.72
    assert shares[Model.RAY_FOLLOWING] > 0.79
