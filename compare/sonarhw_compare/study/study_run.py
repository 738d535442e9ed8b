"""Running a study: compute and write the missing parts, then finish the folder."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from sonarhw_sim.compiled import core_count

from sonarhw_compare.study.arrow import check_arrow
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
    """Predict every scan of a study into `folder`, with `workers` processes (all cores) or the cluster at `scheduler`.

    `progress` is called once for each existing part. Results are the same bit for bit with any number of workers, on
    machines of one kind. Raises InputError if the folder exists already or, with `resume`, belongs to another study.
    Raises MissingExtra if Arrow is not installed. Raises WorkersLost or OutputError if the study cannot finish;
    complete parts are kept.
    """
    check_arrow()  # now, rather than after the first predictions
    target = StudyFolder(folder, study)
    numbers = target.begin(resume)
    for _ in range(part_count(study) - len(numbers)):
        progress()
    if folder.exists():
        return
    workers = core_count() if workers is None else workers
    made = parts_on_cluster(study, numbers, scheduler) if scheduler else parts_here(study, numbers, workers)
    try:
        with closing(made) as parts:
            for part in parts:
                target.write(part)
                progress()
    finally:
        target.drop_if_empty()
    target.finish()
