"""Check the locked dependencies for known vulnerabilities and for projects without releases: `make audit`."""

import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from datetime import date, timedelta
from itertools import chain
from pathlib import Path
from typing import Any

from requirements.lock import CHECKOUT, HERE, PAGE, canonical, entries

Audited = dict[str, Any]  # a package in the output of pip-audit
LONGEST = timedelta(days=3 * 365.25)
ROW = re.compile(r"^\| ([a-z0-9.-]+) \| [^|]+ \| (\d{4}-\d\d-\d\d) \|", flags=re.MULTILINE)
REASON = re.compile(r'# last release \d{4}; .*\n\s*"([\w.-]+)')  # above the dependency in pyproject.toml


def main() -> int:
    """Print the problems and return the exit status: 1 if there are any."""
    project = (CHECKOUT / "pyproject.toml").read_text(encoding="utf-8")
    problems = [*without_releases(project, PAGE.read_text(encoding="utf-8"), date.today())]
    try:
        for versions in locked_versions():
            problems += vulnerable(audit(versions))
    except NotAudited as error:
        print(f"known vulnerabilities: not checked: {error}")
    print("\n".join(problems) or "no problem found")
    return 1 if problems else 0


class NotAudited(Exception):
    """pip-audit could not check the dependencies."""


def dependencies(project: str) -> set[str]:
    """Return the names of the packages that pyproject.toml requires, also in extras and for the build."""
    content = tomllib.loads(project)
    extras = content["project"]["optional-dependencies"].values()
    lines = [*content["build-system"]["requires"], *content["project"]["dependencies"], *chain(*extras)]
    return {canonical(re.split(r"[^\w.-]", line)[0]) for line in lines} - {content["project"]["name"]}


def without_releases(project: str, page: str, today: date) -> Iterator[str]:
    """Yield a line for each dependency whose last release is over three years old and has no reason beside it."""
    released = {name: date.fromisoformat(day) for name, day in ROW.findall(page)}  # the last row is the newest version
    for name in sorted(dependencies(project) - set(map(canonical, REASON.findall(project)))):
        if today - released[name] > LONGEST:
            yield f"{name}: last release {released[name]}; replace it, or give the reason for it in pyproject.toml"


def locked_versions() -> list[dict[str, str]]:
    """Return the version of each package, for the oldest and for the newest Python."""
    pinned = sorted({(match[1], match[2]) for lock in HERE.glob("*.txt") for match in entries(lock)})
    newest = dict(pinned)
    oldest = dict(reversed(pinned))
    return [newest, {name: version for name, version in oldest.items() if newest[name] != version}]


def audit(versions: dict[str, str]) -> list[Audited]:
    """Return what pip-audit reports about each package. Raises NotAudited."""
    with tempfile.TemporaryDirectory() as folder:
        wanted = Path(folder) / "locked.txt"
        wanted.write_text("".join(f"{name}=={version}\n" for name, version in versions.items()))
        command = ["pip-audit", "--disable-pip", "--no-deps", "--format=json", "--progress-spinner=off"]
        done = subprocess.run([*command, f"--requirement={wanted}"], capture_output=True, text=True, check=False)
    try:
        audited: list[Audited] = json.loads(done.stdout)["dependencies"]
    except ValueError as error:  # it ended with an error or a traceback
        raise NotAudited(done.stderr.strip().split("\n")[-1]) from error
    if all("skip_reason" in package for package in audited):
        raise NotAudited("the package index has no list of them")
    return audited


def vulnerable(audited: list[Audited]) -> Iterator[str]:
    """Yield a line for each package with known vulnerabilities, or that could not be checked."""
    for package in audited:
        if "skip_reason" in package:
            yield f"{package['name']}: {package['skip_reason']}"
        for found in package.get("vulns", ()):
            fixed = ", ".join(found["fix_versions"]) or "no version"
            yield f"{package['name']} {package['version']}: {found['id']}, fixed in {fixed}"


if __name__ == "__main__":
    sys.exit(main())
