"""AT and RT against closed forms and a brute force of their own."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.measurement.iso_paths import path_figures, resampled, tangents, through_planes


def circle(radius, m=72, lag=0.0, turns=1.0):
    """A circle of 0.2 m about (0, 0, 0.5), in the xy plane."""
    s = 2 * np.pi * turns * np.arange(m) / (m - 1) + lag
    return np.stack([radius * np.cos(s), radius * np.sin(s), np.full(m, 0.5)], axis=1)


def brute(paths, command, fine=400):
    """AT and RT by walking every path in small steps to the place nearest to each plane."""
    places = np.empty((len(command), len(paths), 3))
    ahead = np.vstack([command[1:], 2 * command[-1] - command[-2]])
    behind = np.vstack([2 * command[0] - command[1], command[:-1]])
    for k, path in enumerate(paths):
        late, early = command[1] - command[0], command[-1] - command[-2]
        more = np.arange(1, 31)[:, None] / 30  # of a long step small ones
        ends = np.vstack([path[0] - late * more[::-1], path, path[-1] + early * more])
        share = np.linspace(0, 1, fine, endpoint=False)[None, :, None]
        walk = (ends[:-1, None] * (1 - share) + ends[1:, None] * share).reshape(-1, 3)
        for i, point in enumerate(command):
            u = (ahead[i] - point) / np.linalg.norm(ahead[i] - point)
            v = (point - behind[i]) / np.linalg.norm(point - behind[i])
            near = walk[np.linalg.norm(walk - point, axis=1) < 0.03]
            places[i, k] = near[np.abs((near - point) @ (u + v)).argmin()]
    AT = RT = 0.0
    for point, seen in zip(command, places, strict=True):
        mean = sum(seen) / len(seen)
        away = [float(np.sqrt(((one - mean) ** 2).sum())) for one in seen]
        s = np.sqrt(sum((a - np.mean(away)) ** 2 for a in away) / (len(away) - 1))
        AT, RT = max(AT, float(np.linalg.norm(mean - point))), max(RT, np.mean(away) + 3 * s)
    return AT, RT


@pytest.mark.parametrize("m", [400, 4000])
def test_a_wider_circle_is_off_by_its_radius_however_late_it_is(m):
    """Chords of k points lie r (1 - cos(pi / k)) inside: 6 um at 400, 0.06 um at 4000."""
    command = circle(0.2)
    late = [circle(0.2003, m, lag) for lag in (-0.01, 0.0, 0.004, 0.013)]
    found = path_figures(resampled(late, command), command)
    chord = 0.2003 * (1 - np.cos(np.pi / (m - 1)))
    AT = found.accuracy.value[1:-1]  # the first and the last plane lie across the first chord
    assert AT.max() <= 0.3e-3 + 1e-9
    assert AT.min() >= 0.3e-3 - chord - 1e-9
    assert found.repeatability.value[1:-1].max() < 4 * chord + 1e-9


def test_at_and_rt_are_those_of_small_steps():
    rng = np.random.default_rng(1)
    command = circle(0.2, 30, turns=0.8)
    paths = []
    for _ in range(6):
        wave = 1e-4 * rng.standard_normal(3) * np.sin(np.linspace(0, 6, 90))[:, None]
        noise = 5e-6 * rng.standard_normal((90, 3))
        paths.append(circle(0.2001, 90, 0.01 * rng.standard_normal(), 0.8) + wave + noise)
    found = path_figures(resampled(paths, command), command)
    AT, RT = brute(paths, command)
    # steps of 1/400 of 5.6 mm miss a plane by 7 um at most, where paths are off by 1 in 100
    assert found.accuracy.value.max() == pytest.approx(AT, abs=1e-6)
    assert found.repeatability.value.max() == pytest.approx(RT, abs=4e-6)


def test_lines_off_by_known_amounts_give_the_figures_by_hand():
    command = np.linspace([0, 0, 0], [1, 0, 0], 5)
    shifts = np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, 0, 0.0]]) * 1e-3
    paths = [np.linspace([0, 0, 0], [1, 0, 0], 31) + shift + [0, 2e-3, 0] for shift in shifts]
    found = path_figures(resampled(paths, command), command)
    np.testing.assert_allclose(found.accuracy.value, 2e-3, atol=1e-15)
    np.testing.assert_allclose(found.repeatability.value, (0.8 + 3 * 0.2**0.5) * 1e-3, atol=1e-15)
    assert found.worst == (int(found.accuracy.value.argmax()), 0)


def test_a_corner_is_cut_by_the_plane_between_its_sides():
    command = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.0]])
    np.testing.assert_allclose(tangents(command)[1], [2**-0.5, 2**-0.5, 0], atol=1e-15)
    rounded = np.array([[0, 0, 0], [0.9, 0, 0], [1, 0.1, 0], [1, 1, 0.0]])
    seen = through_planes(rounded, command)
    np.testing.assert_allclose(seen[1], [0.95, 0.05, 0], atol=1e-12)
    back = tangents(np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0.0]]))
    np.testing.assert_allclose(np.linalg.norm(back, axis=1), 1.0)


def test_what_begins_a_little_late_goes_on_straight_and_what_ends_early_is_not_there():
    command = np.linspace([0, 0, 0], [1, 0, 0], 11)
    late = np.linspace([0.05, 1e-3, 0], [1.0, 1e-3, 0], 11)
    seen = through_planes(late, command)
    np.testing.assert_allclose(seen[:, 1], 1e-3, atol=1e-15)
    assert np.isnan(through_planes(late[:6], command)[-1]).all()
    assert np.isnan(through_planes(late[:1], command)).all()


def test_the_floor_of_at_is_what_paths_without_error_read():
    """Errors that hang together along each path: noise of a walk, of three paths."""
    rng = np.random.default_rng(2)
    command = np.linspace([0, 0, 0], [1, 0, 0], 20)
    read, floors = [], []
    for _ in range(60):
        walk = np.cumsum(1e-5 * rng.standard_normal((20, 3, 3)), axis=0)
        walk -= walk.mean(axis=0)
        found = path_figures(command[:, None] + walk, command)
        read.append(found.accuracy.value.max())
        floors.append(found.floor)
    # both means scatter by about 4 %: three times their root sum; a mean of three takes 18 %
    assert np.mean(floors) == pytest.approx(np.mean(read), rel=0.15)


@pytest.mark.parametrize("command", [np.zeros((3, 3)), np.zeros((1, 3))])
def test_a_path_without_steps_is_refused(command):
    with pytest.raises(InputError, match="is no step on"):
        tangents(command)
