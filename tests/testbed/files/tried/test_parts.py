"""The row at which an instrument moved, in large tables."""

import numpy as np
import pytest

from testbed.files.tried import parts
from testbed.files.tried.parts import parts_of
from tests.testbed.files.made import made


@pytest.mark.parametrize("poses", [False, True])
def test_frames_are_fitted_to_a_few_rows_of_many(poses, monkeypatch):
    """Of 300 000 rows, each fit of some twenty had half of them: 20 s of points, 40 s of poses."""
    data, moved = made(seed=2, m=3000), 2001
    seen = data.T[:, :3, 3].copy()
    seen[moved:] += [2, 1, 0]
    sizes, fit = [], parts.fit_frames
    monkeypatch.setattr(
        parts, "fit_frames", lambda F, *rest, **how: sizes.append(len(F)) or fit(F, *rest, **how)
    )
    F = data.truth.poses(data.q) @ np.linalg.inv(data.truth.chain.T_flange_tool)
    assert parts_of(F, seen, data.T[:, :3, :3] if poses else None) == moved
    assert max(sizes) <= 300
