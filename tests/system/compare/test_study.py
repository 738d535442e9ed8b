"""Studies: validation, reproducible scans, interruption, workers and results."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_compare.study import (
    PathCache,
    load_study,
    part_count,
    predict_case,
    predict_scans,
    read_study,
    read_tables,
    run_study,
)
from sonarhw_compare.study_cases import Cases, OptionValues, Study
from sonarhw_sim.predict.prediction import predict_with

from sonarhw.errors import InputError, MissingExtra
from tests.hang_guard import HANG, wait_until

ROOMS = Path("rooms").resolve()


EXAMPLE = Path("docs/comparing/study_example.toml")


SPEC = f"""
name = "test"
seed = 5
draws = 4
boards = ["paper", "polaroid-6500"]
[[rooms]]
file = "{ROOMS}/simple.toml"
places = ["figure9", "anywhere"]
[headings]
step = 30.0
[vary.board]
threshold_db = [-40, -36.5]
aperture_radius = {{ uniform = [0.016, 0.0192] }}
[vary.options]
max_bounces = 4
rays = 720
"""

# no two scans have the same paths
PLACES = f"""
name = "places"
seed = 3
draws = 8
boards = ["lego-nxt", "polaroid-6500"]
[[rooms]]
file = "{ROOMS}/arena.toml"
places = ["anywhere"]
[headings]
step = 20.0
"""


def spec_of(folder: Path, text: str = SPEC) -> Path:
    path = folder / "spec.toml"
    path.write_text(text)
    return path


def study_of(folder: Path, text: str = SPEC) -> Study:
    return load_study(spec_of(folder, text))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_noise_has_a_seed_of_its_own_for_each_case_and_of_the_study(tmp_path: Path) -> None:
    def seeds(study_seed: int, noise: float) -> list[int | None]:
        text = SPEC.replace("seed = 5", f"seed = {study_seed}")
        more = 'receiver = "board"\nnoise = ' + str(noise)
        cases = Cases(study_of(tmp_path, text.replace("max_bounces = 4", f"max_bounces = 4\n{more}")))
        return [cases.case(number).options.seed for number in range(6)]

    drawn = seeds(5, 0.1)
    assert len(set(drawn)) == 6
    assert None not in drawn
    assert seeds(5, 0.1) == drawn
    assert not set(seeds(6, 0.1)) & set(drawn)
    assert set(seeds(5, 0.0)) == {None}


def test_a_scan_of_a_study_equals_simulate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = f'name = "one"\nboards = ["paper"]\n[[rooms]]\nfile = "{ROOMS}/kuc_siegel.toml"\nplaces = ["figure6"]\n'
    assert run(["study", str(spec_of(tmp_path, text)), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    command = ["simulate", f"{ROOMS}/kuc_siegel.toml", "--place", "figure6", "--board", "paper"]
    capsys.readouterr()
    assert run(command) == 0
    rows = [line.split(",") for line in capsys.readouterr().out.splitlines()[1:]]
    simulated = np.array([[float(value or "nan") for value in row[:5]] for row in rows]).T
    scan = read_study(tmp_path / "out").isel(scan=0)
    found = [scan.heading_deg, scan.range_m, scan.path_m, scan.level_db, scan.bounces]
    np.testing.assert_allclose(np.array(found), simulated, rtol=1e-8)
    assert scan.n_echo == np.isfinite(simulated[1]).sum()


@pytest.mark.parametrize("text", [SPEC, PLACES])
def test_a_scan_depends_on_its_number_only(tmp_path: Path, text: str) -> None:
    study = study_of(tmp_path, text)
    together = predict_scans(study, 0, study.scans)
    apart = [predict_scans(study, number, number + 1) for number in reversed(range(study.scans))][::-1]
    for kind in (0, 1):
        rows = [row for one in apart for row in one[kind].to_pylist()]
        assert together[kind].to_pylist() == rows


def test_shared_paths_do_not_change_results(tmp_path: Path) -> None:
    study = study_of(tmp_path)
    cases, cache = Cases(study), PathCache()
    for number in range(8):
        case = cases.case(number)
        alone = predict_with(case.model, case.room, case.place, case.board, case.headings, case.options)
        np.testing.assert_array_equal(predict_case(case, cache).ranges, alone.ranges)


def test_places_that_are_searched_together_have_the_results_of_single_predictions(tmp_path: Path) -> None:
    study = study_of(tmp_path, PLACES)
    scans, headings = predict_scans(study, 0, study.scans)
    cases = [Cases(study).case(number) for number in range(study.scans)]
    single = [
        predict_with(case.model, case.room, case.place, case.board, case.headings, case.options) for case in cases
    ]
    for name, of_scan in (
        ("range_m", lambda scan: scan.ranges),
        ("path_m", lambda scan: scan.reported_paths.lengths),
        ("level_db", lambda scan: scan.reported_paths.levels),
        ("bounces", lambda scan: np.where(scan.winners >= 0, scan.reported_paths.bounces, np.nan)),
    ):
        expected = np.concatenate([of_scan(scan) for scan in single])
        columns = headings[name].cast("float64").to_numpy()
        assert np.isclose(columns, expected, rtol=1e-6, equal_nan=True).mean() > 0.999
    assert scans["n_echo"].to_pylist() == [int(np.isfinite(scan.ranges).sum()) for scan in single]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows delivers Ctrl-C through a console")
def test_ctrl_c_while_workers_start_prints_one_line(tmp_path: Path) -> None:
    spec, out = spec_of(tmp_path, SPEC.replace("draws = 4", "draws = 400")), tmp_path / "out"
    command = [str(Path(sys.executable).with_name("sonarhw")), "study", str(spec), "--out", str(out), "--workers", "2"]
    study = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    # the first part is computed before the workers start; now they import
    wait_until(lambda: list(tmp_path.glob("out.unfinished/scans/part-*")))
    # to the whole process group, as a terminal does
    os.killpg(study.pid, signal.SIGINT)
    message = study.communicate(timeout=HANG)
    assert study.returncode == 130
    assert message == ("", f"sonarhw: interrupted; finished parts are in {out}.unfinished: continue with --resume\n")


def test_draws_are_the_same_over_the_grid_and_with_additional_keys(tmp_path: Path) -> None:
    study = study_of(tmp_path)
    more = study_of(tmp_path, SPEC + "[vary.air]\ntemperature_c = { normal = [20.0, 2.0] }\n")
    scans, _ = predict_scans(study, 0, study.scans)
    fuller, _ = predict_scans(more, 0, more.scans)
    drawn = np.reshape(scans["board.aperture_radius"], (study.draws, -1))
    assert (drawn == drawn[:, :1]).all()
    assert len(np.unique(drawn)) == study.draws
    anywhere = np.array(scans["place"]) == "anywhere"
    assert len(np.unique(np.array(scans["x_m"])[anywhere])) == study.draws
    for key in ("board.aperture_radius", "x_m", "y_m"):
        assert scans[key].to_pylist() == fuller[key].to_pylist()
    warmth = np.unique(fuller["air.temperature_c"])
    assert len(warmth) == study.draws
    assert (np.abs(warmth - 20) < 6).all()


def test_processes_write_the_same_files_and_an_interrupted_study_resumes(tmp_path: Path) -> None:
    study, whole, broken = study_of(tmp_path), tmp_path / "whole", tmp_path / "broken"
    run_study(study, whole, workers=1)

    class Interrupted(Exception):
        pass

    done = iter(range(3))

    def until_the_third() -> None:
        if next(done, None) is None:
            raise Interrupted

    with pytest.raises(Interrupted):
        run_study(study, broken, workers=1, progress=until_the_third)
    assert not broken.exists()
    with pytest.raises(InputError, match="not finished"):
        read_tables(broken)
    unfinished = tmp_path / "broken.unfinished"
    kept = {path: path.stat().st_mtime_ns for path in unfinished.rglob("*.parquet")}
    assert 0 < len(kept) < 2 * part_count(study)
    with pytest.raises(InputError, match="resume it"):
        run_study(study, broken)
    with pytest.raises(InputError, match="another study"):
        run_study(study_of(tmp_path, SPEC.replace("seed = 5", "seed = 6")), broken, resume=True)

    run_study(study, broken, workers=2, resume=True)
    assert contents(broken) == contents(whole)
    for path, written in kept.items():
        assert (broken / path.relative_to(unfinished)).stat().st_mtime_ns == written
    run_study(study, broken, resume=True)
    for taken in (broken, Path(), Path("..")):
        with pytest.raises(InputError, match="exists already"):
            run_study(study, taken)


def test_results_are_arrays_with_varied_values_as_coordinates(tmp_path: Path) -> None:
    assert run(["study", str(EXAMPLE), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    results = read_study(tmp_path / "out")
    assert dict(results.sizes) == {"scan": 36, "heading_deg": 36}
    assert sorted(set(results["board.threshold_db"].values)) == [-46.0, -40.0, -34.0]
    with_echo = results.range_m.notnull().sum("heading_deg")
    np.testing.assert_array_equal(with_echo, results.n_echo)
    # a lower threshold does not detect fewer echoes
    by_threshold = results.n_echo.groupby("board.threshold_db").mean().values
    assert by_threshold[0] >= by_threshold[1] >= by_threshold[2]


def test_the_document_shows_the_example_and_names_every_column(tmp_path: Path) -> None:
    document = Path("docs/comparing/study.md").read_text()
    assert f"```toml\n{EXAMPLE.read_text()}```" in document
    study = study_of(tmp_path)
    scans, headings = predict_scans(study, 0, 1)
    figures = scans.column_names[scans.column_names.index("n") :]
    assert [name for name in (*figures, *headings.column_names[1:]) if f"`{name}`" not in document] == []
    assert [name for name in OptionValues.model_fields if f"`{name}`" not in document] == []


def test_a_study_without_a_cluster_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sonarhw_compare.study.ANSWER_WITHIN", 0.2)
    command = ["study", str(spec_of(tmp_path)), "--out", str(tmp_path / "out")]
    for scheduler in ("tcp://127.0.0.1:1", "nonsense://127.0.0.1:1"):  # none at this port, and no such protocol
        assert run([*command, "--scheduler", scheduler]) == 2
        assert "no Dask scheduler answers" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtra, match=r"'\.\[study\]'"):
        run_study(study_of(tmp_path), tmp_path / "out", scheduler="tcp://127.0.0.1:1")
    assert [path.name for path in tmp_path.iterdir()] == ["spec.toml"]


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Yield the URL of a Dask scheduler and its two workers, all separate processes."""
    dask = [sys.executable, "-m", "dask"]
    where, log = folder / "scheduler.json", (folder / "dask.log").open("wb")
    environment = os.environ | {"DASK_DISTRIBUTED__WORKER__DAEMON": "False"}

    def begin(*arguments: str) -> subprocess.Popen[bytes]:
        command = [*dask, *arguments, "--scheduler-file", str(where), "--no-dashboard"]
        return subprocess.Popen(command, stdout=log, stderr=log, env=environment)

    processes = [begin("scheduler", "--host", "127.0.0.1", "--port", "0")]
    try:
        wait_until(lambda: where.exists() and where.read_text().endswith("}"))  # the file is written in place
        worker = ["worker", "--nworkers", "1", "--nthreads", "1", "--no-nanny", "--local-directory", str(folder)]
        processes += [begin(*worker), begin(*worker)]
        yield json.loads(where.read_text())["address"], processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()
        log.close()


def test_a_cluster_writes_the_same_files_even_if_a_worker_is_killed(tmp_path: Path) -> None:
    spec = spec_of(tmp_path, SPEC.replace("draws = 4", "draws = 10"))
    run_study(load_study(spec), tmp_path / "here", workers=1)
    there = tmp_path / "there"
    with cluster(tmp_path) as (url, workers):
        command = [Path(sys.executable).with_name("sonarhw"), "study", spec, "--out", there, "--scheduler", url]
        study = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        wait_until(lambda: list(tmp_path.glob("there*/scans/part-*")))
        assert study.poll() is None
        workers[0].send_signal(signal.SIGKILL)
        _, message = study.communicate()
        assert (study.returncode, message) == (0, b"")
        assert workers[1].poll() is None
    assert contents(there) == contents(tmp_path / "here")
