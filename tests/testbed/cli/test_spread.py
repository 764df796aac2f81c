"""What scenes/README.md says of five seeds: printed from one file, which a study plays again."""

import json

import pytest

from testbed.assets import scenes
from tests.golden.spread import FIGURES, SEEDS, Figure, kept, spread, table
from tests.golden.write import SCENES
from tests.testbed.cli.test_scenes import TOLERANCE

README = (scenes() / "README.md").read_text(encoding="utf-8")


def test_every_scene_that_is_run_has_figures_at_five_seeds():
    assert set(FIGURES) == set(SCENES) == set(kept())
    assert len(set(SEEDS)) == 5
    for scene, figures in FIGURES.items():
        assert {figure.words for figure in figures} == set(kept()[scene])
        assert len({figure.words for figure in figures}) == len(figures)
        assert all(len(values) == len(SEEDS) for values in kept()[scene].values())


@pytest.mark.parametrize("scene", FIGURES)
def test_the_readme_of_the_scenes_states_each_figure_with_its_spread(scene):
    assert f"### `{scene}`\n" in README
    assert table(scene) in README.split(f"### `{scene}`\n")[1].split("\n### ")[0]


def test_a_figure_is_printed_with_its_mean_and_its_ends():
    figure = Figure("error", "a/b", 1, " %", 100.0, -100.0)
    assert figure.of({"a": {"b": 1.25}}) == 25.0
    assert figure.printed([1.0, 3.0, 2.0]) == "2.0 (1.0 to 3.0) %"
    assert figure.printed([-0.01, -0.01]) == "0.0 %"


@pytest.mark.study
@pytest.mark.parametrize("scene", FIGURES)
def test_every_figure_comes_out_again_at_full_size(scene, tmp_path):
    """Minutes a scene: all figures at all seeds, as a user's own runs give them."""
    again = spread(scene, tmp_path)
    for words, values in kept()[scene].items():
        assert again[words] == pytest.approx(values, rel=TOLERANCE, abs=1e-9), words
    assert json.dumps(again, allow_nan=False)
