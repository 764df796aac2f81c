"""Plans of this room have few points on their curves."""

import pytest

from tests.planned import few_points


@pytest.fixture(autouse=True, scope="module")
def _few_points():
    with few_points():
        yield
