"""Compilation of kernels by numba; the code is cached on disk. The first call of a kernel imports this module."""

import gc
import pickle
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import event
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps

from sonarhw_sim.compilation import kernel_count, watcher
from sonarhw_sim.kernels.kernel_key import key_of, slot_of
from sonarhw_sim.kernels.kernel_store import NotStored, kernel_folders, store, stored

_Result: Any = CompileResult
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
    if "no_cpython_wrapper" in options:

        def add(result: Any) -> None:
            # without the registration for calls by Python, which would call address 0
            dispatcher.overloads[tuple(result.signature.args)] = result

        dispatcher.add_overload, dispatcher._compile_for_args = add, _refuse(dispatcher)
    return dispatcher


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
                return _Result._rebuild(target_context, *pickle.loads(payload))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Store the code for a signature. If that is not possible, the next run compiles again."""
        if result.lifted or result.library.has_dynamic_globals:
            return  # the code contains addresses of this process
        name = self._name(signature, result.codegen)
        try:
            store(name, name.rpartition("-")[0], _dumps(result._reduce()))
        except NotStored as reason:
            _progress.not_stored(str(reason))

    def _name(self, signature: Any, codegen: Any) -> str:
        """Return the name of the file: kernel, slot, key."""
        processor, kernel = codegen.magic_tuple(), self._kernel
        key = key_of(kernel, self._options, signature, processor)
        path = f"{kernel.__module__}.{kernel.__qualname__}".replace("<", "").replace(">", "")
        return f"{path}-{slot_of(signature, processor)}-{key}"


class _Progress(_event.Listener):  # type: ignore[misc]  # numba declares no types for it
    """Counts compiled kernels and reports them."""

    def __init__(self) -> None:
        self._done = self._depth = 0
        self._reported = self._collects = False

    def on_start(self, _: Any) -> None:
        """Report that compilation is in progress."""
        if not self._depth:
            # the compiler creates millions of objects that live until its end; searching them for garbage takes seconds
            self._collects = gc.isenabled()
            gc.disable()
        self._depth += 1
        watcher().compiling(self._done, kernel_count())

    def on_end(self, happened: Any) -> None:
        """Count the kernel; report the end if no caller of the kernel is being compiled."""
        self._depth -= 1
        self._done += isinstance(happened.data["dispatcher"]._cache, _KernelCache)
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
