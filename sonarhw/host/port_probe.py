"""Whether a scanner answers at a port, in one line to be read.

Takes a URL; opens it, asks, and closes it again. Asking may reset whatever hangs on a port.
"""

from sonarhw.errors import SonarError
from sonarhw.host.scanner import Scanner

PATIENCE = 2.5  # s; a board that its opened port has reset needs some


def probe_port(url: str, patience: float = PATIENCE) -> tuple[bool, str]:
    """Whether a scanner answers at `url` within `patience` s, and who it is or why not."""
    try:
        with Scanner.open(url, patience=patience) as scanner:
            return True, f"scanner {scanner.info.serial}, {scanner.info.firmware}"
    except SonarError as error:
        return False, f"no scanner: {str(error).removeprefix(f'{url}: ')}"
