"""How far a long work is: what begins now, how long each step took, how much memory it needed."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field

Progress = Callable[[str, int, int], None]
"""Called with (what begins now, steps done, steps in all); an empty name at the end."""


@dataclass(slots=True)
class Clock:
    """Wall time of each step, without the steps nested in it, and memory at its end."""

    seconds: dict[str, float] = field(default_factory=dict)
    memory: dict[str, float] = field(default_factory=dict)
    _open: list[tuple[str, float, float]] = field(default_factory=list)

    def begin(self, name: str) -> None:
        """Start a step."""
        self._open.append((name, time.perf_counter(), 0.0))

    def end(self) -> float:
        """End the step begun last; its wall time [s] without nested steps."""
        name, start, nested = self._open.pop()
        whole = time.perf_counter() - start
        if self._open:
            outer, since, inside = self._open[-1]
            self._open[-1] = (outer, since, inside + whole)
        self.seconds[name] = whole - nested
        self.memory[name] = round(peak_memory_mb(), 1)
        return whole - nested


def peak_memory_mb() -> float:
    """Largest resident memory of this process so far [MB]; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0.0
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
