"""The installed plug-ins for devices, by the scheme of their URLs."""

from functools import cache
from importlib.metadata import EntryPoint, entry_points

from sonarhw.errors import InputError
from sonarhw.plugins.device_plugin import DevicePlugin

GROUP = "sonarhw.devices"
# also found if the source folder is used without an installation, which has no entry points
_OWN = (EntryPoint("lines", "sonarhw.text.text_device:TextDevice", GROUP),)


def is_plugin(url: str) -> bool:
    """Return whether a plug-in opens this URL."""
    return url.partition(":")[0] in _installed()


def make_plugin(url: str) -> DevicePlugin:
    """Return the device at a URL, not yet opened. Raises InputError for an invalid URL or a plug-in without a class."""
    point = _installed()[url.partition(":")[0]]
    try:
        found = point.load()
    except (ImportError, AttributeError) as error:
        raise InputError(f"{url}: the plug-in {point.value} cannot be loaded: {error}; install it again") from error
    if not (isinstance(found, type) and issubclass(found, DevicePlugin)):
        raise InputError(f"{url}: the plug-in {point.value} is not a subclass of sonarhw.DevicePlugin")
    return found(url)


def takes_orders(url: str) -> bool:
    """Return whether a scan at this URL may choose its angles, as all scanners do but devices that turn by themselves.

    Raises InputError for an invalid URL of a plug-in.
    """
    return not is_plugin(url) or make_plugin(url).takes_orders


@cache
def _installed() -> dict[str, EntryPoint]:
    # a package must not replace the schemes of this one
    return {point.name: point for point in (*entry_points(group=GROUP), *_OWN)}
