"""Compilation of loops: at import, for one signature, and cached if possible.

The compiler caches code beside the source, or else in the user's cache, so that threads find the
loops ready. Fused and reordered arithmetic is off: results have the same bits on every CPU and for
any number of threads. The cached code of a loop is renewed only if its own file changes, so each
file has all the compiled code that it calls. If numba cannot be imported, a loop is the plain
Python function: many replicates are then computed by numpy (`calib.kernels.loops`), and one pose by
the interpreter.
"""

from collections.abc import Callable
from typing import Any

try:
    from numba import njit, types
except ImportError:
    njit = types = None


def has_compiler() -> bool:
    """Whether numba could be imported."""
    return njit is not None


def compiled(*signature: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Compile at import for one signature, without a cache if none can be written."""
    options = {"nogil": True, "error_model": "numpy", "fastmath": False}

    def compile_(function: Callable[..., None]) -> Callable[..., None]:
        if njit is None:
            return function
        try:
            return njit([types.void(*signature)], cache=True, **options)(function)  # type: ignore[no-any-return]  # numba is untyped
        except (RuntimeError, OSError):
            pass  # no place, or no room on the disk: the code is compiled again below
        return njit([types.void(*signature)], **options)(function)  # type: ignore[no-any-return]  # numba is untyped

    return compile_


def array_in(dimensions: int, kind: str = "float64") -> Any:
    """Type of an input array: contiguous, and read-only, which accepts writeable arrays too."""
    return types and types.Array(getattr(types, kind), dimensions, "C", readonly=True)


def array_out(dimensions: int) -> Any:
    """Type of an array that the loop writes."""
    return types and types.Array(types.float64, dimensions, "C")


def part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that compiled loops call."""
    return njit(error_model="numpy", fastmath=False)(function) if njit else function
