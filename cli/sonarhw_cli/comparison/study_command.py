"""`sonarhw study`: predict thousands of scans over grids and random draws, into a folder of Parquet files."""

from pathlib import Path
from typing import Annotated

import typer

from sonarhw.errors import InputError, counted
from sonarhw_cli.console.lines import print_error, print_line
from sonarhw_cli.console.progress import progress

StudyFile = Annotated[
    Path, typer.Argument(help="Study file (*.toml), such as docs/comparing/study_example.toml.", metavar="SPEC")
]
StudyFolder = Annotated[
    Path | None,
    typer.Option(
        help="Folder to create; default: the study file's name, in this folder.", metavar="DIR", show_default=False
    ),
]
Workers = Annotated[
    int | None, typer.Option(min=1, max=1024, help="Number of processes; default: one for each core.", metavar="N")
]
Scheduler = Annotated[
    str | None,
    typer.Option(help="Predict on the Dask cluster of this scheduler.", metavar="tcp://HOST:PORT"),
]


def study(
    spec: StudyFile,
    out: StudyFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted study.")] = False,
) -> None:
    """Predict every scan of a study. The results do not depend on the number of workers."""
    from sonarhw_compare.study import load_study, part_count, run_study, unfinished_of

    if workers is not None and scheduler is not None:
        raise InputError("--workers, --scheduler: a cluster has its own workers; give only one of them")
    folder = Path(spec.stem) if out is None else out
    plan = load_study(spec)
    with progress(part_count(plan), lambda: "Predicting") as advance:
        try:
            run_study(plan, folder, workers=workers, scheduler=scheduler, resume=resume, progress=advance)
        except KeyboardInterrupt:
            unfinished = unfinished_of(folder)
            if unfinished.exists():
                print_error(f"interrupted; finished parts are in {unfinished}: continue with --resume")
            raise
    print_line(f"{counted(plan.scans, 'scan')} in {folder}")
