"""The guard itself: what does not end fails, whoever catches what, and what ends passes."""

import re
from contextlib import suppress

import pytest

from tests.hangs import no_hang


def endless():
    while True:
        pass


def backtracking():
    re.match("(a+)+b", "a" * 60)


@pytest.mark.parametrize("work", [endless, backtracking])
def test_what_hangs_is_stopped_and_fails(work):
    stopped = pytest.raises(pytest.fail.Exception, match=r"not done after 0\.02 s")
    with stopped, no_hang(0.02), suppress(Exception):  # as readers that hold it for the input's
        work()


def test_what_ends_passes_and_what_it_raises_too():
    with no_hang():
        pass
    with pytest.raises(KeyError), no_hang():
        raise KeyError
