"""How inner loops are compiled."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, TypeVar

import numba

if TYPE_CHECKING:
    from collections.abc import Callable

P = ParamSpec('P')
R = TypeVar('R')


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """
    Compile a function when it is first called; the result is kept on disk.

    Functions that call each other must be in one file: the cache notices a change in the file of
    a function that is called from outside, not in the files of the functions that it calls.
    """
    dispatcher = numba.njit(cache=True, nogil=True, error_model='numpy')(function)
    if isinstance(dispatcher, numba.core.registry.CPUDispatcher):  # else compiling is turned off
        _drop_stale(dispatcher.stats.cache_path, function)
    fast: Callable[P, R] = dispatcher
    return fast


def _drop_stale(cache: str | None, function: Callable[P, R]) -> None:
    """
    Remove what is kept of a function as it was before its file changed.

    The cache does that, too, but loads what it has first, and fails if a class in it is gone.
    """
    if cache is None:
        return
    source = Path(function.__code__.co_filename)
    for index in Path(cache).glob(f'{source.stem}.{function.__qualname__}-*.nbi'):
        with contextlib.suppress(FileNotFoundError):  # another process was faster
            if index.stat().st_mtime < source.stat().st_mtime:
                index.unlink()
