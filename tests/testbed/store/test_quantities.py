"""Stated figures: published as they were written, whatever unit memory keeps them in."""

import numpy as np
import pytest

from testbed.store.quantities import METRE, RADIAN, stated


def test_a_stated_number_comes_back_with_its_own_digits():
    written = [k / 10 for k in range(1, 2000)]
    assert sum(one * 1e-6 * 1e6 != one for one in written) > 500
    assert all(stated("tolerance_um", one * 1e-6, METRE).shown == one for one in written)
    assert all(stated("x_deg", float(np.radians(one)), RADIAN).shown == one for one in written)
    assert stated("point_mm", np.array(written) * 1e-3, METRE).shown == written


def test_its_name_ends_in_its_unit():
    with pytest.raises(ValueError, match="does not end in one of"):
        stated("tolerance", 1.0, METRE)
