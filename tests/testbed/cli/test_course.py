"""Time left: as true as what steps took before, on any machine, with any workers."""

import json

import numpy as np
import pytest

from testbed.assets import scene_names
from testbed.cli import timings
from testbed.cli.course import TimeLeft, Took
from testbed.run.play import planned_steps
from testbed.studies import load_scenario


class Hand:
    """A clock that is set by hand."""

    now = 100.0

    def __call__(self):
        return self.now


def played(expected, actual, *, workers=1, known=None, every=0.2, kept=()):
    """(elapsed, left, share) all along a work that really takes `actual` (name, piece seconds)."""
    clock = Hand()
    course = TimeLeft(expected if known is None else known, workers, clock)
    steps = sum(len(pieces) for _, pieces in actual)
    said, done = [], 0

    def wait(seconds):
        for _ in range(max(round(seconds / every), 1) if seconds else 0):
            clock.now += seconds / max(round(seconds / every), 1)
            said.append((clock.now - 100.0, course.left(), course.share()))

    for name, pieces in actual:
        if name in kept:
            done += len(pieces)
            continue
        course(name, done, steps)
        ends = np.zeros(workers)  # pieces go to whoever is free
        finished = []
        for seconds in pieces:
            free = np.argmin(ends)
            ends[free] += seconds
            finished.append(ends[free])
        last = 0.0
        for k, end in enumerate(sorted(finished)):
            wait(end - last)
            last = end
            if k < len(pieces) - 1:
                course(name, done + k + 1, steps)
        done += len(pieces)
    course("", steps, steps)
    assert course.left() == 0.0
    return said, course


def off(said, until=0.9):
    """Largest relative error of the time left after the first third, up to a share of all."""
    whole = said[-1][0]
    late = [(t, left) for t, left, _ in said if whole / 3 <= t <= until * whole]
    return max(abs(left / (whole - t) - 1) for t, left in late)


EXPECTED = {
    "setting": Took(1.0), "best-61": Took(9.0), "random-61": Took(3.0), "sets": Took(0.4),
    "coverage": Took(40.0, 8), "result.json": Took(2.0), "report.html": Took(12.0),
    "campaign.rrd": Took(6.0),
}  # fmt: skip


def as_expected(pace=1.0, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    return [
        (
            name,
            [
                pace * took.seconds / took.pieces * np.exp(noise * rng.standard_normal())
                for _ in range(took.pieces)
            ],
        )
        for name, took in EXPECTED.items()
    ]


@pytest.mark.parametrize("pace", [0.5, 1.0, 2.0, 3.0])
def test_a_faster_or_slower_machine_is_seen_by_the_first_third(pace):
    said, _ = played(EXPECTED, as_expected(pace))
    # at a third TRUST leaves (c / 3 + T) / (1 / 3 + T) / c - 1: 13 % at half the time
    assert off(said) < 0.2  # and less than a piece is not seen yet
    assert pace != 1.0 or off(said) < 0.02


def test_noise_of_single_steps_leaves_the_time_left_within_thirty_percent():
    # steps that scatter by 15 % (a quiet machine), on one three quarters as fast
    # of the last steps nothing but themselves tells
    errors = [off(played(EXPECTED, as_expected(1.33, 0.15, seed))[0], 0.7) for seed in range(15)]
    assert np.quantile(errors, 0.9) < 0.3


@pytest.mark.parametrize("workers", [2, 4])
def test_pieces_side_by_side_take_their_share(workers):
    said, course = played(EXPECTED, as_expected(), workers=workers)
    assert off(said) < 0.3  # pieces end in groups, up to one of them is not seen coming
    assert course.took["coverage"].seconds == pytest.approx(40.0)
    said, _ = played(EXPECTED, as_expected(1.5), workers=workers)
    assert off(said) < 0.3


def test_processes_that_begin_slowly_are_not_taken_for_slow_ones():
    # each of two imports for as long as a piece takes, and they do not end together
    actual = [
        (name, [10.0, 12.0, *pieces[2:]] if name == "coverage" else pieces)
        for name, pieces in as_expected()
    ]
    before = EXPECTED | {"coverage": Took(52.0, 8)}
    assert off(played(before, actual, workers=2)[0]) < 0.3


def test_a_step_that_never_was_is_counted_by_its_pieces():
    pieces = [("many", [1.0] * 50)]
    said, _ = played({}, pieces, known={})
    assert off(said) < 0.1


def test_of_a_study_that_was_never_played_nothing_is_said_before_a_piece_has_ended():
    unknown = EXPECTED | {"coverage": Took(np.nan, 8)}
    said, course = played(EXPECTED, as_expected(), known=unknown)
    began, first = 13.4, 5.0
    assert all(left is None for t, left, _ in said if t < began + first - 0.2)
    assert off([row for row in said if row[1] is not None]) < 0.1
    assert course.took["coverage"] == Took(pytest.approx(40.0), 8)


def test_what_was_kept_is_not_waited_for():
    said, _ = played(EXPECTED, as_expected(), kept=("setting", "best-61", "coverage"))
    assert off([row for row in said if row[0] > 4.0]) < 0.3


def test_the_bar_moves_inside_a_step_and_never_back():
    rows, _ = played(EXPECTED, as_expected(1.7, 0.5, 3))
    shares = [share for _, _, share in rows]
    assert np.all(np.diff(shares) >= 0)
    inside = [share for t, _, share in rows if 2.0 < t < 15.0]  # best-61 alone
    assert inside[-1] - inside[0] > 0.1
    assert len(set(inside)) > 50
    assert max(shares) <= 1.0


def test_nothing_known_says_nothing_at_first():
    course = TimeLeft(clock=Hand())
    assert (course.left(), course.share()) == (None, 0.0)
    course("a", 0, 3)
    assert course.left() is None


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv(timings.FOLDER, str(tmp_path / "cache"))
    timings.own.cache_clear()
    yield tmp_path / "cache" / timings.FILE
    timings.own.cache_clear()


def test_the_last_run_decides_what_the_next_one_may_take(cache):
    took = {"setting": Took(2.0), "coverage": Took(80.0, 8), "mine": Took(5.0)}
    timings.remember("run coverage", took)
    assert timings.expected("run coverage") == took
    assert timings.total("run coverage") == 87.0
    # more robots: more pieces of the same length
    planned = {"setting": 1, "coverage": 16, "mine": 1}
    assert timings.expected("run coverage", planned)["coverage"] == Took(160.0, 16)


def test_a_small_study_of_the_same_name_says_nothing_of_the_scene(cache):
    """150 robots of `million` took 36 s, and the list of scenes said so of a night of computing."""
    whole = timings.shipped()["run million"]
    night = timings.total("run million")
    timings.remember("run million", {**whole, "coverage": Took(32.0, 6)})
    assert timings.total("run million") == pytest.approx(night)


def test_another_machine_is_told_by_what_was_played_on_both(cache):
    first = timings.shipped()["run quick"]
    timings.remember("run quick", {k: Took(3 * v.seconds, v.pieces) for k, v in first.items()})
    wen2022 = sum(took.seconds for took in timings.shipped()["run wen2022"].values())
    assert timings.total("run wen2022") == pytest.approx(3 * wen2022)


def test_a_scene_that_was_never_played_is_likened_to_one_with_its_steps(cache, monkeypatch):
    near = {"setting": Took(1.0), "theirs": Took(4.0), "sets": Took(2.0), "report.html": Took(3.0)}
    far = {"setting": Took(9.0), "coverage": Took(90.0, 8), "report.html": Took(9.0)}
    works = {"run far": far, "run near": near, "plan near": {"own-40": Took(77.0)}}
    monkeypatch.setattr(timings, "shipped", lambda: works)
    planned = {"setting": 1, "own-40": 1, "sets": 1, "report.html": 1}
    guess = timings.expected("run mine", planned)
    assert list(guess.items()) == [
        ("setting", Took(1.0)), ("own-40", Took(4.0)), ("sets", Took(2.0)),
        ("report.html", Took(3.0)),
    ]  # fmt: skip
    assert timings.expected("merge mine") == {}
    assert np.isnan(timings.expected("run mine", {"coverage": 6})["coverage"].seconds)


@pytest.mark.parametrize(
    "text", ["", "[", "[]", "{}", '{"run a": 3}', '{"run a": {"b": ["x", 1]}}', "[" * 100_000]
)
def test_a_damaged_file_is_as_good_as_none(text, cache):
    cache.parent.mkdir()
    cache.write_text(text)
    assert timings.own() == {}
    timings.remember("run a", {"b": Took(1.0)})
    assert timings.total("run a") == 1.0


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    for place in (str(tmp_path / "file"), "/proc/nobody", "relative\0", ""):
        if "\0" not in place:
            monkeypatch.setenv(timings.FOLDER, place)
        timings.own.cache_clear()
        timings.remember("run a", {"b": Took(1.0)})
        assert timings.own() == {}
    timings.own.cache_clear()


def test_so_many_works_are_remembered_and_the_last_one_first(cache, monkeypatch):
    monkeypatch.setattr(timings, "MOST_WORKS", 4)
    for k in range(timings.MOST_WORKS + 5):
        timings.remember(f"run {k}", {"b": Took(1.0)})
    assert len(timings.own()) == timings.MOST_WORKS
    assert next(iter(json.loads(cache.read_text()))) == f"run {timings.MOST_WORKS + 4}"
    assert timings.expected("run new") == {"b": Took(1.0)}


@pytest.mark.parametrize("name", scene_names())
def test_the_shipped_times_are_those_of_the_steps_that_there_are(name):
    steps, planned = timings.shipped()[f"run {name}"], planned_steps(load_scenario(name))
    assert set(steps) <= set(planned), f"python -m tests.timings {name}"
    pieces = {step: took.pieces for step, took in steps.items()}
    assert pieces == {step: planned[step] for step in steps}, f"python -m tests.timings {name}"
    # a step that is not told is part of another one, and short
    assert len(set(planned) - set(steps)) <= 3
