"""Lock version and hashes of every dependency, and list the dependencies with their licences.

`make lock` runs this program with uv and pip. It writes one file `requirements/NAME.txt` for each extra of
`pyproject.toml`, valid for every system and Python version, and the page `docs/reference/licences.md`. Locked versions
are kept if `pyproject.toml` permits them. With `--upgrade`, the newest versions are locked.
"""

import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from datetime import date
from pathlib import Path
from typing import Any

from packaging.markers import Marker

Package = dict[str, Any]  # an entry of pylock.toml

HERE = Path(__file__).parent
CHECKOUT = HERE.parent
PAGE = CHECKOUT / "docs" / "reference" / "licences.md"
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))

# The extras, and the files that each is installed with. Packages of those files are not repeated.
EXTRAS = {
    "install": ("base",),
    "gui": ("base",),
    "study": ("base",),
    "foxglove": ("base",),
    "rooms": ("base",),
    "ros": ("base",),
    "video": ("base",),
    "dev": ("base", "foxglove", "gui", "rooms", "ros", "study", "video"),
    "docs": ("base", "gui"),
    "audit": ("base",),
    "benchmarks": ("base",),
}
STATED = {"pyroomacoustics": "MIT"}  # its metadata holds the text of the licence, without the name
# of the libraries that wheels contain beside the package itself, which its metadata does not name
IN_WHEELS = {"av": "wheels contain FFmpeg (LGPL-3.0-or-later), x264 and x265 (GPL-2.0-or-later)"}
# one entry of a lock: a package with its version, then its hashes
ENTRY = re.compile(r"^([a-z0-9.-]+)==([^ ;]+).*\n(?: .*\n)+", flags=re.MULTILINE)

TITLE = "# Written by `make lock`: versions and hashes of the packages of `{name}`{beside}.\n"
HEAD = """# Dependencies and licences

sonarhw itself has the MIT licence. `make lock` writes this table of every package that an installation can contain, on
any system. The last column names the file in `requirements/` that locks the package. An installation without extras
contains only the packages of `base`; `build` is the build backend.

| package | version | released | licence | locked by |
|---|---|---|---|---|
"""


def main() -> None:
    """Write the locks, then the page."""
    with tempfile.TemporaryDirectory() as folder:
        everything = Path(folder) / "everything.txt"
        everything.write_text("\n".join({match[0] for path in HERE.glob("*.txt") for match in entries(path)}))
        resolve("--all-extras", f"--output-file={everything}", *sys.argv[1:])
        write_locks(everything)
        pylock = Path(folder) / "pylock.toml"
        resolve("--all-extras", f"--constraint={everything}", f"--output-file={pylock}")
        packages = tomllib.loads(pylock.read_text(encoding="utf-8"))["packages"]
    PAGE.write_text(HEAD + "".join(rows(packages, licences(packages))), encoding="utf-8")


def entries(lock: Path) -> list[re.Match[str]]:
    """Return the entries of a lock: the whole entry, the package and its version."""
    return list(ENTRY.finditer(lock.read_text(encoding="utf-8")))


def resolve(*options: str, sources: Iterable[str] = ("pyproject.toml", "-")) -> str:
    """Return the packages that the sources need on any system; `-` is the build backend."""
    output = ["--quiet", "--no-header", "--no-annotate", "--generate-hashes"]
    command = ["uv", "pip", "compile", "--no-config", "--universal", "--python-version=3.11", *output, *options]
    build = "\n".join(PROJECT["build-system"]["requires"])
    done = subprocess.run(
        [*command, *sources], cwd=CHECKOUT, input=build, stdout=subprocess.PIPE, text=True, check=True
    )
    return done.stdout


def write_locks(everything: Path) -> None:
    """Write one file for the build backend, one for the base and one for each extra."""
    constraint = f"--constraint={everything}"
    texts = {"build": resolve(constraint, sources=["-"]), "base": resolve(constraint, sources=["pyproject.toml"])}
    for name in EXTRAS:
        texts[name] = resolve(constraint, f"--extra={name}", sources=["pyproject.toml"])
    for name, text in texts.items():
        beside = EXTRAS.get(name, ())
        present = {match[0] for other in beside for match in ENTRY.finditer(texts[other])}
        added = [match[0] for match in ENTRY.finditer(text) if match[0] not in present]
        title = TITLE.format(name=name, beside=f" beside {', '.join(beside)}" if beside else "")
        (HERE / f"{name}.txt").write_text(title + "".join(added), encoding="utf-8")


def licences(packages: Iterable[Package]) -> dict[str, str]:
    """Return the licence of each package, as its metadata states it."""
    versions: dict[str, str] = {}
    for package in packages:  # of several versions, the one for this Python
        if package["name"] not in versions or Marker(package["marker"]).evaluate():
            versions[package["name"]] = package["version"]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--no-deps", "--ignore-installed"]
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", suffix=".txt") as wanted:
        wanted.writelines(f"{name}=={version}\n" for name, version in versions.items())
        wanted.flush()
        report = subprocess.run(
            [*pip, "--report=-", f"--requirement={wanted.name}"], stdout=subprocess.PIPE, check=True
        )
    found = (package["metadata"] for package in json.loads(report.stdout)["install"])
    return {canonical(metadata["name"]): licence(metadata) for metadata in found} | STATED


def canonical(name: str) -> str:
    """Return the name of a package as the locks write it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def licence(metadata: dict[str, Any]) -> str:
    """Return the licence expression of a package, or else its licence classifiers or the first line of its licence."""
    classified = [name.split(" :: ")[-1] for name in metadata.get("classifier", ()) if name.startswith("License :: ")]
    first_line = metadata.get("license", "").strip().split("\n")[0]
    return metadata.get("license_expression") or ", ".join(classified) or first_line


def release_date(package: Package) -> date:
    """Return the day of the first file of a release."""
    files = [*package.get("wheels", ()), *([package["sdist"]] if "sdist" in package else ())]
    first: date = min(file["upload-time"] for file in files).date()
    return first


def rows(packages: Iterable[Package], licence_of: dict[str, str]) -> Iterator[str]:
    """Yield the rows of the table."""
    locked_by = defaultdict(list)
    for name in ("build", "base", *EXTRAS):
        for match in entries(HERE / f"{name}.txt"):
            locked_by[match[1], match[2]].append(name)
    for package in packages:
        name, version = package["name"], package["version"]
        stated = "; ".join(filter(None, (licence_of[name], IN_WHEELS.get(name))))
        cells = (name, version, release_date(package), stated, ", ".join(locked_by[name, version]))
        yield f"| {' | '.join(map(str, cells))} |\n"


if __name__ == "__main__":
    main()
