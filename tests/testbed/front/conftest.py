"""One small campaign for all that looks at results."""

import pytest

import truebed
from testbed.scenario.read import changed
from testbed.studies import load_scenario

SMALL = {
    "identification.estimators": ["whitened"],
    "uncertainty.replications": 0,
    "uncertainty.repeats": 2,
    "studies.random_sets": 0,
}


@pytest.fixture(scope="session")
def campaign():
    return truebed.run(changed(load_scenario("quick"), SMALL))
