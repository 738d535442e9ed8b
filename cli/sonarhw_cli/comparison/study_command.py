"""`sonarhw study`: thousands of predicted scans over grids and random draws, into a folder of Parquet."""

from pathlib import Path
from typing import Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.interruption import sigterm_raises
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.progress import progress


def study(
    spec: Annotated[Path, typer.Argument(help="Study file (*.toml).", metavar="SPEC")],
    out: Annotated[
        Path | None, typer.Option(help="Folder to make; default: the study file's name, here.", show_default=False)
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes that predict; default: one a core.", metavar="N")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Let the Dask cluster of this scheduler predict instead.", metavar="tcp://HOST:PORT"),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where an interrupted study stopped.")] = False,
) -> None:
    """Predict every scan of a study; the results are the same whatever the number of workers."""
    from sonarhw_compare.study import load_study, run_study
    from sonarhw_compare.study.parts import part_count, unfinished_of

    if workers is not None and scheduler is not None:
        raise InputError("--workers: a cluster has its own; leave it out, or --scheduler")
    folder = Path(spec.stem) if out is None else out
    wanted = load_study(spec)
    with sigterm_raises(), progress(part_count(wanted), lambda: "Predicting") as advance:
        try:
            run_study(wanted, folder, workers=workers, scheduler=scheduler, resume=resume, progress=advance)
        except KeyboardInterrupt:
            unfinished = unfinished_of(folder)
            if unfinished.exists():
                typer.echo(f"sonarhw: interrupted; what is done is in {unfinished}: go on with --resume", err=True)
            raise
    typer.echo(f"{counted(wanted.scans, 'scan')} in {folder}")
