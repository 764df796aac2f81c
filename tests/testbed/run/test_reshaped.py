"""Records sealed again with an array of another shape: refused, or it belongs to no other."""

import numpy as np
import pytest

from calib.errors import CalibError
from testbed.identify.folder import play_calibration, rederive_calibration
from testbed.run.play import play_run, rederive
from testbed.store import layout, npz
from testbed.studies import load_scenario
from tests.calibrated import robot, sound_session

DERIVED = (layout.RESULT, layout.ARRAYS)


def reshaped(array):
    """The array with one entry less and one more along each of its axes."""
    for axis in range(array.ndim):
        if array.shape[axis]:
            yield np.delete(array, -1, axis=axis)
            yield np.concatenate([array, np.take(array, [-1], axis=axis)], axis=axis)


def calibrated(folder):
    play_calibration(robot(), sound_session(), folder)
    return rederive_calibration


def played(folder):
    play_run(load_scenario("quick"), folder)
    return rederive


@pytest.mark.study
@pytest.mark.parametrize("make", [calibrated, played])
def test_no_array_of_another_shape_ends_in_a_defect(make, tmp_path):
    """Every array of a whole folder, along every axis; what is accepted has been read and used."""
    folder = tmp_path / "run"
    again = make(folder)
    counts = dict.fromkeys(("refused", "accepted"), 0)
    for file in sorted((folder / layout.TRIALS).glob("*.npz")):
        good = file.read_bytes()
        meta, arrays = npz.from_bytes(good)
        for name, array in arrays.items():
            for other in reshaped(array):
                file.write_bytes(npz.to_bytes(meta, {**arrays, name: other}))
                try:
                    again(folder, DERIVED)
                    counts["accepted"] += 1
                except CalibError:
                    counts["refused"] += 1
                except Exception as error:
                    raise AssertionError(f"{file.name} {name} {other.shape}") from error
        file.write_bytes(good)
    assert counts["refused"] > 3 * counts["accepted"]
