"""Check whether a scanner answers at a port. Opening a port may reset the board behind it."""

from sonarhw.errors import SonarError
from sonarhw.host.scanner import Scanner

PATIENCE = 2.5  # s; a board that was reset by the opening of its port needs time to start


def probe_port(url: str, patience: float = PATIENCE) -> tuple[bool, str]:
    """Return whether a scanner answers at `url` within `patience` s, and its identity or the reason in one line."""
    try:
        with Scanner.open(url, patience=patience) as scanner:
            return True, f"scanner {scanner.info.serial}, {scanner.info.firmware}"
    except SonarError as error:
        return False, f"no scanner: {str(error).removeprefix(f'{url}: ')}"
