"""Content of a record's file, from which fields take what is theirs."""

from bisect import bisect_left
from collections.abc import Mapping
from typing import Any


class Left(dict[str, Any]):
    """What is not taken yet, by dotted path."""

    def __init__(self, packed: Mapping[str, Any]) -> None:
        super().__init__(packed)
        self._paths = sorted(packed)

    def had(self, path: str) -> bool:
        """Whether anything was below a path at first; found by bisection, for it is asked often."""
        below = f"{path}."
        place = bisect_left(self._paths, below)
        return place < len(self._paths) and self._paths[place].startswith(below)
