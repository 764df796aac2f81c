"""What the presets leave behind after plain fits: the table of the specification, section 5."""

import pytest

from tests.testbed.laboratory.outcomes import outcome

ROBOTS, FEW = 24, 12


@pytest.mark.truth
@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "fit", "m", "before", "random", "designed", "chi"),
    [
        ("rigid", "ols24", 29, 0.46, 0.0149, 0.0132, None),
        ("wen2022", "gls24", 29, 0.455, 0.081, 0.087, (4.7, 7.0)),
        ("wen2022", "gls24", 61, 0.455, 0.075, 0.083, (4.7, 7.0)),
        ("wen2022", "extended", 29, 0.455, 0.0208, 0.0192, (1.0, 1.0)),
        ("soft", "gls30", 29, 0.57, 0.180, 0.189, (19.0, 32.0)),
        ("soft", "extended", 29, 0.57, 0.0234, 0.0201, (1.0, 1.0)),
    ],
)
def test_a_preset_leaves_what_the_specification_says(preset, fit, m, before, random, designed, chi):
    found = outcome(preset, fit, m, ROBOTS)
    # robots differ by 25 % before and 15 % after: a median of 24 has 6 % and 4 %, as has the one
    # in the table; three of both together, and 5 % for another pool of held-out poses
    assert found.before == pytest.approx(before, rel=0.30)
    assert found.random == pytest.approx(random, rel=0.20)
    assert found.designed == pytest.approx(designed, rel=0.20)
    if chi is not None:
        # robots differ by 40 % in chi-square where the model is wrong, by 10 % where it is right
        slack = 0.5 if chi[0] > 2 else 0.12
        assert found.chi_random == pytest.approx(chi[0], rel=slack)
        assert found.chi_designed == pytest.approx(chi[1], rel=slack)


@pytest.mark.truth
@pytest.mark.slow
@pytest.mark.parametrize("preset", ["unmodelled", "elastic"])
def test_no_offered_model_explains_an_unmodelled_or_elastic_robot(preset):
    found = outcome(preset, "extended", 61, FEW)
    # chi-square per degree of freedom, of 300, has sd .08, a median of 12 robots .03: were
    # the model right it would lie within four of those of 1
    assert found.chi_random > 1.12
    # and yet it calibrates much better than the geometric model alone
    assert found.random < 0.5 * outcome(preset, "gls30", 61, FEW).random
