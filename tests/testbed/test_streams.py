"""Named streams: independent, reproducible, never moved by their neighbors."""

import numpy as np
import pytest

from calib.errors import InputError
from testbed.streams import stream


def test_a_stream_depends_on_its_names_only():
    a, b = (stream(7, "tracker", "optimal-29").normal(size=3) for _ in range(2))
    assert (a == b).all()
    for other in (
        stream(7, "tracker", "random-29"),
        stream(8, "tracker", "optimal-29"),
        stream(7, "optimal-29", "tracker"),
        stream(7, "trackeroptimal-29"),
        stream(7, "tracker"),
        stream(7),
    ):
        assert not (a == other.normal(size=3)).any()


def test_the_number_three_is_not_the_text_three():
    assert stream(7, 3).integers(2**62) != stream(7, "3").integers(2**62)


def test_first_numbers_never_change_between_versions():
    # numpy promises PCG64's stream (NEP 19); the key is sha256: written down once, valid for ever
    first = stream(2022, "tracker", "best-29", 1).integers(0, 2**32, 3).tolist()
    assert first == [4247347481, 3486946133, 3166538825]


def test_streams_of_different_names_are_uncorrelated():
    n = 20_000
    draws = np.array([stream(1, "pose", k).normal(size=n) for k in range(20)])
    correlation = np.corrcoef(draws)[np.triu_indices(20, 1)]
    assert np.abs(correlation).max() < 5 / np.sqrt(n)  # 5 sd over 190 pairs: 1e-4 false alarms


@pytest.mark.parametrize("seed", [-1, 1.5, True, "7", None])
def test_a_seed_that_is_not_a_natural_number_is_refused(seed):
    with pytest.raises(InputError, match=r"seed is .*; expected a whole number, 0 or larger"):
        stream(seed, "x")
