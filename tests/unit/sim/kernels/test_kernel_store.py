"""Files of compiled code: damage is detected, unwritable folders are skipped, old code is replaced."""

import errno
import os
import sys
from pathlib import Path

import pytest
from sonarhw_sim import compiler
from sonarhw_sim.compiler import kernel_folders, store, stored

CODE = bytes(range(256)) * 8


@pytest.fixture
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    chosen = [tmp_path / "installation" / "__pycache__", tmp_path / "home" / "kernels"]
    monkeypatch.setattr(compiler, "kernel_folders", lambda: chosen)
    return chosen


def test_what_was_stored_is_read_again(folders: list[Path]) -> None:
    store("walk-float-1", "walk-float", CODE)
    assert stored(folders[0], "walk-float-1") == CODE
    assert stored(folders[0], "walk-float-2") is None
    assert [file.name for file in folders[0].iterdir()] == ["walk-float-1.kernel"]


def test_a_truncated_or_changed_file_is_not_used_and_is_replaced(folders: list[Path]) -> None:
    store("walk-float-1", "walk-float", CODE)
    file = folders[0] / "walk-float-1.kernel"
    whole = file.read_bytes()
    for length in (0, 1, 31, 32, 33, len(whole) - 1):
        file.write_bytes(whole[:length])
        assert stored(folders[0], "walk-float-1") is None
    for place in (0, 32, len(whole) - 1):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        assert stored(folders[0], "walk-float-1") is None
    store("walk-float-1", "walk-float", CODE)
    assert stored(folders[0], "walk-float-1") == CODE


def test_new_code_replaces_the_old_code_of_its_slot_only(folders: list[Path]) -> None:
    for name in ("walk-float-1", "walk-int-1", "walk-float-2"):
        store(name, name.rpartition("-")[0], CODE)
    assert {file.stem for file in folders[0].iterdir()} == {"walk-int-1", "walk-float-2"}


def test_a_read_only_installation_uses_the_folder_of_the_user(folders: list[Path]) -> None:
    folders[0].parent.write_text("not a folder")
    store("walk-float-1", "walk-float", CODE)
    assert stored(folders[0], "walk-float-1") is None
    assert stored(folders[1], "walk-float-1") == CODE


def test_the_error_names_each_folder_and_its_reason(folders: list[Path]) -> None:
    for folder in folders:
        folder.parent.write_text("not a folder")
    reason = store("walk-float-1", "walk-float", CODE)
    assert reason == f"{folders[0]}: Not a directory; {folders[1]}: Not a directory"


def test_a_full_disk_is_named_and_leaves_no_part(folders: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_part: str, _path: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", fail)
    assert "No space left on device" in str(store("walk-float-1", "walk-float", CODE))
    assert not [*folders[0].iterdir(), *folders[1].iterdir()]


def test_numba_cache_dir_replaces_the_default_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    installation, home = kernel_folders()
    assert installation.parent.name == "sonarhw_sim"
    assert home != installation
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    assert kernel_folders() == [tmp_path]


@pytest.mark.skipif(sys.platform == "win32", reason="no pwd")
def test_a_user_without_an_account_has_no_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    import pwd

    def fail(number: int) -> None:
        raise KeyError(number)

    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", fail)
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    assert [folder.name for folder in kernel_folders()] == ["__pycache__"]
