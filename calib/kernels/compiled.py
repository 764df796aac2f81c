"""How loops are compiled: at import, for one signature, kept where possible.

The compiler keeps code beside the source, or else in the user's cache. Threads then find the loops
ready. Fused and reordered arithmetic stays off: the same bits on every CPU and for any number of
threads. The kept code of a loop watches its own file only, so that each file holds all the compiled
code it calls. Where numba cannot be imported, a loop is the Python function that it is written as:
many replicates are then played by numpy (`calib.kernels.loops`), and one pose by the interpreter.
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
    """Compile at once for one signature; where the cache cannot be written, without it."""
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
    """An input array: contiguous; a read-only signature takes writeable arrays too."""
    return types and types.Array(getattr(types, kind), dimensions, "C", readonly=True)


def array_out(dimensions: int) -> Any:
    """An array that is written."""
    return types and types.Array(types.float64, dimensions, "C")


def part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that compiled loops call."""
    return njit(error_model="numpy", fastmath=False)(function) if njit else function
