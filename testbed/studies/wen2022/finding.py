"""One claim of the paper judged by one campaign."""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["holds", "in part", "does not hold", "misprint"]


@dataclass(frozen=True, slots=True)
class Finding:
    """A verdict in one word, the number behind it, and one sentence."""

    number: int
    """Of the claim in `testbed.studies.wen2022.paper.CLAIMS`."""
    verdict: Verdict
    ours: str
    """The number of this campaign that stands beside the printed one, with its unit."""
    sentence: str


def within(value: float, expected: float, relative: float) -> bool:
    """Whether a value lies within a relative tolerance of the expected one."""
    return abs(value - expected) <= relative * abs(expected)
