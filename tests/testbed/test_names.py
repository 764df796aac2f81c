"""Which name was meant by a word that names nothing."""

import pytest

from testbed.names import name_meant

ROBOTS = ("kuka_iiwa7", "staubli_tx60", "universal_ur10")
SCENES = (
    "compensate",
    "coverage",
    "million",
    "position_only",
    "quick",
    "stations",
    "wen2022_moving",
)


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("ur10", "universal_ur10"),
        ("Stäubli", "staubli_tx60"),
        ("stabuli", "staubli_tx60"),
        ("iwa7", "kuka_iiwa7"),
        ("uinversal", "universal_ur10"),
    ],
)
def test_names_cut_short_or_misspelled_are_found(word, meant):
    assert name_meant(word, ROBOTS) == f'did you mean "{meant}"?'


@pytest.mark.parametrize("word", ["nothing", "x", "", "robot", "q" * 1000])
def test_no_name_is_proposed_for_a_word_that_shares_some_letters(word):
    assert name_meant(word, SCENES) == ""
