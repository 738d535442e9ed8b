"""The key of compiled code: a digest of everything that the code depends on.

It covers the kernel, every kernel and constant that it uses from any module, the argument types, the versions of the
compiler, and the processor. Compiled code with another key is never used.
"""

import sys
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from hashlib import sha256
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.types import BaseTuple

_TUPLE: Any = BaseTuple
_LIBRARIES = ("numpy", "math", "cmath")  # modules that a kernel may use; `versions` stands for their contents


def versions() -> str:
    """Return the versions of everything that compiles a kernel."""
    return f"numba {numba.__version__}, llvmlite {llvmlite.__version__}, numpy {np.__version__}, Python {sys.version}"


def slot_of(signature: Any, processor: tuple[str, ...]) -> str:
    """Return a name for the argument types, the processor and the Python version: new code replaces old code there."""
    return _digest(f"{signature} {processor} {sys.implementation.cache_tag}")[:10]


def key_of(kernel: Callable[..., Any], options: str, signature: Any, processor: tuple[str, ...]) -> str:
    """Return the key of a kernel for argument types and compiler options.

    Raises TypeError if the kernel uses a value whose changes the key would miss.
    """
    types = " ".join(_fields(signature))
    return _digest(f"{versions()} {options} {processor} {types} {digest_of(kernel)}")[:32]


def _fields(type_of_argument: Any) -> Iterator[str]:
    """Yield the types of arguments, with the classes and field names of named tuples."""
    yield str(type_of_argument)
    of = getattr(type_of_argument, "instance_class", None)
    if of is not None:
        yield _class(of)
    if isinstance(type_of_argument, (tuple, _TUPLE)):
        for part in type_of_argument:
            yield from _fields(part)


@cache
def digest_of(kernel: Callable[..., Any]) -> str:
    """Return a digest of a kernel and of everything that it uses. Raises TypeError as `key_of` does."""
    function: Any = kernel
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    used = [function.__globals__[name] for name in sorted(_names(function.__code__)) if name in function.__globals__]
    where = f"{function.__module__}.{function.__qualname__}"
    # stored code loads the modules of the kernels that it uses by name
    parts = [
        where,
        *_code(function.__code__),
        *(_value(value, where) for value in (*cells, *used, function.__defaults__)),
    ]
    return _digest("\n".join(parts))


def _names(code: CodeType) -> set[str]:
    return {*code.co_names, *(name for part in code.co_consts if isinstance(part, CodeType) for name in _names(part))}


def _code(code: CodeType) -> Iterator[str]:
    """Yield what a function does; line numbers and comments are not part of it."""
    yield f"{code.co_code.hex()} {code.co_exceptiontable.hex()} {code.co_names} {code.co_varnames} {code.co_freevars}"
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code(constant)
        else:
            yield repr(sorted(map(repr, constant)) if isinstance(constant, frozenset) else constant)


def _value(value: Any, where: str) -> str:
    """Return a text that is another one for another value."""
    match value:
        case None | bool() | int() | float() | complex() | str() | bytes() | Enum() | np.generic():
            return f"{type(value)} {value!r}"
        case tuple():
            return f"{type(value)} {[_value(part, where) for part in value]}"
        case np.ndarray():
            return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
        case ModuleType() if value.__name__ in _LIBRARIES:
            return value.__name__
        case type() if issubclass(value, tuple) or value.__module__ in ("builtins", *_LIBRARIES):
            return _class(value)
        case BuiltinFunctionType() | np.ufunc():
            return repr(value)
        case FunctionType() if value.__module__.partition(".")[0] in _LIBRARIES:
            return f"{value.__module__}.{value.__qualname__}"
    if hasattr(value, "py_func"):
        return digest_of(value.py_func)
    raise TypeError(
        f"kernel {where} uses {value!r}: a kernel may use kernels, numbers, text, arrays, tuples, enums, "
        f"and names of {', '.join(_LIBRARIES)}; import names from other modules, not the modules"
    )


def _class(of: type) -> str:
    return f"{of.__module__}.{of.__qualname__} {getattr(of, '_fields', ())}"


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()
