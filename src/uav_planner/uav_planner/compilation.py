"""How inner loops are compiled."""

from __future__ import annotations

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
    fast: Callable[P, R] = numba.njit(cache=True, nogil=True, error_model='numpy')(function)
    return fast
