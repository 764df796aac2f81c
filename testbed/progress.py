"""How far a long work is: what begins now, how long each step took, how much memory it needed."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

Progress = Callable[[str, int, int], None]
"""Called with (what begins now, steps done, steps in all); an empty name at the end."""


@dataclass(slots=True)
class Clock:
    """Wall time of each step, without the steps nested in it, and memory at its end."""

    seconds: dict[str, float] = field(default_factory=dict)
    memory: dict[str, float] = field(default_factory=dict)
    _nested: float = 0.0
    """Of steps that ended inside the one that is open [s]."""

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time what is done inside, without the steps nested in it [s]."""
        start, before, self._nested = time.perf_counter(), self._nested, 0.0
        try:
            yield
        finally:
            whole = time.perf_counter() - start
            self.seconds[name] = whole - self._nested
            self.memory[name] = round(peak_memory_mb(), 1)
            self._nested = before + whole


def peak_memory_mb() -> float:
    """Largest resident memory of this process so far [MB]; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0.0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
