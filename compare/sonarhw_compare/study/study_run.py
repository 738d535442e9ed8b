"""Running a study: the parts that are not there yet are made and kept, and the folder gets its name when all are.

Takes a `Study` and a folder; leaves the folder, or what was done of it by then.
"""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from sonarhw_compare.cores import core_count
from sonarhw_compare.study.parts import StudyFolder, part_count
from sonarhw_compare.study.spec import Study
from sonarhw_compare.study.workers import parts_here, parts_on_cluster


def run_study(
    study: Study,
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    progress: Callable[[], None] = lambda: None,
) -> None:
    """Predict every scan of a study into `folder`, by `workers` processes (all cores) or the cluster at `scheduler`.

    `progress` is called once for each part that is there. Results are the same bit for bit, whoever makes them, on
    machines of one kind. Raises InputError where the folder is there already or, with `resume`, holds another study;
    WorkersLost or OutputError where it ends before its time: what is done is kept.
    """
    place = StudyFolder(folder, study)
    numbers = place.begin(resume)
    for _ in range(part_count(study) - len(numbers)):
        progress()
    if folder.exists():
        return
    workers = core_count() if workers is None else workers
    made = parts_on_cluster(study, numbers, scheduler) if scheduler else parts_here(study, numbers, workers)
    try:
        with closing(made) as parts:
            for part in parts:
                place.write(part)
                progress()
    finally:
        place.drop_if_empty()
    place.finish()
