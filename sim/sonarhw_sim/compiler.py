"""Compilation of kernels by numba, and the files of compiled code. The first call of a kernel imports this module."""

import gc
import os
import pickle
import sys
import tempfile
from collections.abc import Callable, Iterator
from enum import Enum
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba import njit
from numba.core import config, event
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps
from numba.core.types import BaseTuple
from platformdirs import user_cache_path

from sonarhw_sim.compilation import kernel_count, watcher

# The key of compiled code: a digest of everything that the code depends on.
#
# It covers the kernel, every kernel and constant that it uses from any module, the argument types, the versions of
# the compiler, and the processor. Compiled code with another key is never used.


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


# Files of compiled code: written whole or not at all, with a checksum, in the first folder that accepts them.


_SUFFIX = ".kernel"
_CHECKSUM = sha256().digest_size


def kernel_folders() -> list[Path]:
    """Return the folders for compiled code, in order of preference: NUMBA_CACHE_DIR alone, if it is set."""
    chosen = getattr(config, "CACHE_DIR", "")
    if chosen:
        return [Path(chosen)]
    return [Path(__file__).parent / "__pycache__", *_folder_of_user()]


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


def store(name: str, slot: str, payload: bytes) -> str | None:
    """Write a file, and delete other files whose names begin with `slot`. Return why no folder accepts it, or None."""
    reasons = []
    for folder in kernel_folders():
        try:
            _write(folder / (name + _SUFFIX), sha256(payload).digest() + payload)
        except OSError as error:
            reasons.append(f"{folder}: {error.strerror or error}")
            continue
        _delete_others(folder, name, slot)
        return None
    return "; ".join(reasons)


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


# Compilation; the code is cached on disk.


_Compiled: Any = CompileResult
_event: Any = event
_njit: Any = njit
_dumps: Any = dumps
_runtime: Any = rtsys


def dispatcher_of(function: Callable[..., Any], options: dict[str, object]) -> Any:
    """Return the object of numba that compiles `function` with `options`."""
    dispatcher = _njit(**options)(function)
    if "inline" in options:
        dispatcher._compile_for_args = _refuse(dispatcher)
        return dispatcher
    dispatcher._cache = _KernelCache(dispatcher)
    dispatcher._compile_for_args = _with_room_for_calls(dispatcher._compile_for_args)
    if "no_cpython_wrapper" in options:

        def add(result: Any) -> None:
            # without the registration for calls by Python, which would call address 0
            dispatcher.overloads[tuple(result.signature.args)] = result

        dispatcher.add_overload, dispatcher._compile_for_args = add, _refuse(dispatcher)
    return dispatcher


def _with_room_for_calls(compile_for_args: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that compiles like this one, in less time.

    Python allocates the frames of calls in chunks of 16 KiB. Where a loop begins near the end of a chunk, each of its
    calls allocates the next chunk from the system and frees it again, which took up to a third of the time. A function
    that states such a large stack gets a chunk of 1 MiB, of which the calls below it use the other half.
    """

    def compile_kernel(*arguments: Any, **named: Any) -> Any:
        return compile_for_args(*arguments, **named)

    compile_kernel.__code__ = compile_kernel.__code__.replace(co_stacksize=2**19 // 8)
    return compile_kernel


def _refuse(dispatcher: Any) -> Callable[..., None]:
    def refuse(*_arguments: Any, **_named: Any) -> None:
        raise TypeError(f"{dispatcher.__name__} can be called by kernels only; decorate it with @compiled instead")

    return refuse


class _KernelCache:
    """The compiled code of one kernel on disk, in the form that numba's dispatcher calls.

    numba's own cache checks only the file of the kernel itself, so it can use old code of a kernel in another file. It
    raises errors for damaged files and unwritable folders.
    """

    cache_path = None

    def __init__(self, dispatcher: Any) -> None:
        self._kernel, self._options = dispatcher.py_func, repr(sorted(dispatcher.targetoptions.items()))

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the code for a signature; None if it must be compiled."""
        # target_context.refresh() would load all that the compiler needs, in 0.2 s; the compiler calls it itself
        _runtime.initialize(target_context)
        name = self._name(signature, target_context.codegen())
        for folder in kernel_folders():
            payload = stored(folder, name)
            if payload is not None:
                return _Compiled._rebuild(target_context, *pickle.loads(payload))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Store the code for a signature. If that is not possible, the next run compiles again."""
        if result.lifted or result.library.has_dynamic_globals:
            return  # the code contains addresses of this process
        name = self._name(signature, result.codegen)
        if reason := store(name, name.rpartition("-")[0], _dumps(result._reduce())):
            _progress.not_stored(reason)

    def _name(self, signature: Any, codegen: Any) -> str:
        """Return the name of the file: kernel, slot, key."""
        processor, kernel = codegen.magic_tuple(), self._kernel
        key = key_of(kernel, self._options, signature, processor)
        path = f"{kernel.__module__}.{kernel.__qualname__}".replace("<", "").replace(">", "")
        return f"{path}-{slot_of(signature, processor)}-{key}"


class _Progress(_event.Listener):  # type: ignore[misc]  # numba declares no types for it
    """Counts compiled kernels and reports them."""

    def __init__(self) -> None:
        self._compiled: set[Any] = set()  # kernels; one that is compiled for several types of arguments counts once
        self._depth = 0
        self._reported = self._collects = False

    def on_start(self, _: Any) -> None:
        """Report that compilation is in progress."""
        if not self._depth:
            # the compiler creates millions of objects that live until its end; searching them for garbage takes seconds
            self._collects = gc.isenabled()
            gc.disable()
        self._depth += 1
        watcher().compiling(len(self._compiled), kernel_count())

    def on_end(self, happened: Any) -> None:
        """Count the kernel; report the end if no caller of the kernel is being compiled."""
        self._depth -= 1
        dispatcher = happened.data["dispatcher"]
        if isinstance(dispatcher._cache, _KernelCache):
            self._compiled.add(dispatcher)
        if not self._depth:
            if self._collects:
                # at its end, a search would take another second; instead, the process that compiles keeps 80 MB more
                gc.freeze()
                gc.enable()
            watcher().compiled()

    def not_stored(self, reason: str) -> None:
        """Report once that compiled code cannot be stored."""
        if not self._reported:
            watcher().not_stored(
                f"compiled kernels cannot be stored, so each command compiles them again: {reason}. "
                "Set NUMBA_CACHE_DIR to a writable folder with 20 MB of free space"
            )
        self._reported = True


_progress = _Progress()
_event.register("numba:compile", _progress)
