"""One claim of the paper judged by one campaign."""

from dataclasses import dataclass
from typing import Literal, TypeVar

T = TypeVar("T")
Verdict = Literal["holds", "in part", "does not hold", "misprint"]


@dataclass(frozen=True, slots=True)
class Finding:
    """A verdict in one word, the number behind it, and one sentence."""

    verdict: Verdict
    ours: str
    """The number of this campaign that stands beside the printed one, with its unit."""
    sentence: str


class NotPlayedError(LookupError):
    """The campaign has not played what a claim is about."""


def played(record: T | None) -> T:
    """What a claim is about, if the campaign played it.

    Raises
    ------
    NotPlayedError
        It did not.
    """
    if record is None:
        raise NotPlayedError
    return record


def graded(shown: bool, partly: bool) -> Verdict:
    """Holds, or holds in part at least, or does not."""
    return "holds" if shown else "in part" if partly else "does not hold"
