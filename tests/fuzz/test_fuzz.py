"""Whatever is in a file: read whole or refused in words, at once; no defect of ours shows."""

import pytest

from tests.fuzz.judge import failures, report
from tests.fuzz.targets import TARGETS

IN_ALL = 1000
STUDY = 100_000


def share(kind, count):
    """Inputs of a kind among so many."""
    return -(-count * TARGETS[kind].share // sum(target.share for target in TARGETS.values()))


@pytest.mark.parametrize("kind", TARGETS)
def test_damaged_input_is_refused_in_words_or_read_whole(kind, tmp_path):
    found = failures(kind, 0, share(kind, IN_ALL), tmp_path)
    assert not found, report(found)


@pytest.mark.study
@pytest.mark.parametrize("kind", TARGETS)
def test_a_hundred_thousand_damaged_inputs(kind, tmp_path):
    found = failures(kind, 1, share(kind, STUDY), tmp_path)
    assert not found, report(found)
