"""Options in errors of the library, which names none: it serves the window and Python programs too."""

import re

_OPTIONS = (
    (r"^(free|prior|fit|pings) (?=\S+: )", r"--\1 "),
    (r"^places: expected", "--place: expected"),
    (r"; free it too, or", "; add it to --free, or"),
    (r"; give a room$", "; give one with --room"),
    (r"; give a place, or free the position$", "; give --place, or add position to --free"),
    (r"; give a place, or X,Y in metres;", "; give --place NAME or --place X,Y in metres;"),
    (r": give a place, or X,Y in metres;", ": give --place NAME or --place X,Y in metres;"),
)


def with_options(message: str) -> str:
    """Return an error of the library with the names of the options that the reader needs."""
    for words, option in _OPTIONS:
        message = re.sub(words, option, message)
    return message
