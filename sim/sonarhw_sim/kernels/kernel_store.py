"""Files of compiled code: written whole or not at all, with a checksum, in the first folder that accepts them."""

import os
import tempfile
from hashlib import sha256
from pathlib import Path

from numba.core import config
from platformdirs import user_cache_path

_SUFFIX = ".kernel"
_CHECKSUM = sha256().digest_size


class NotStored(Exception):
    """No folder accepts compiled code. The message contains each folder and the reason."""


def kernel_folders() -> list[Path]:
    """Return the folders for compiled code, in order of preference: NUMBA_CACHE_DIR alone, if it is set."""
    chosen = getattr(config, "CACHE_DIR", "")
    if chosen:
        return [Path(chosen)]
    return [Path(__file__).parents[1] / "__pycache__", *_folder_of_user()]


def _folder_of_user() -> list[Path]:
    """Return the folder of the user; none for a user without a home, such as a bare number in a container."""
    try:
        folder = user_cache_path("sonarhw") / "kernels"
    except RuntimeError:
        return []
    # older versions of platformdirs return ~/.cache unexpanded
    return [folder] if folder.is_absolute() else []


def stored(folder: Path, name: str) -> bytes | None:
    """Return the contents of a file; None if it is missing, unreadable or damaged."""
    try:
        contents = (folder / (name + _SUFFIX)).read_bytes()
    except OSError:
        return None
    checksum, payload = contents[:_CHECKSUM], contents[_CHECKSUM:]
    return payload if sha256(payload).digest() == checksum else None


def store(name: str, slot: str, payload: bytes) -> None:
    """Write a file, and delete other files whose names begin with `slot`. Raises NotStored."""
    reasons = []
    for folder in kernel_folders():
        try:
            _write(folder / (name + _SUFFIX), sha256(payload).digest() + payload)
        except OSError as error:
            reasons.append(f"{folder}: {error.strerror or error}")
            continue
        _delete_others(folder, name, slot)
        return
    raise NotStored("; ".join(reasons))


def _write(path: Path, contents: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    number, part = tempfile.mkstemp(".part", ".kernel-", path.parent)
    try:
        with open(number, "wb") as file:
            file.write(contents)
        os.replace(part, path)
    except BaseException:
        os.unlink(part)
        raise


def _delete_others(folder: Path, name: str, slot: str) -> None:
    for other in folder.glob(f"{slot}-*{_SUFFIX}"):
        if other.name != name + _SUFFIX:
            other.unlink(missing_ok=True)
