"""Sessions that identify, and do not stand where the file says they do."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.frames import inverse, log_so3
from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from tests.testbed.files.campaign import place, session, visit, written
from tests.testbed.files.made import ROBOT, csv
from tests.testbed.files.test_session import ARMS, points_of

GEOMETRIC = Options(model="geometric")
SAME = {part: f'{part} = "same as a"' for part in ("base", "tool")}


def off(k, part):
    """How far base (seen from the station) or tool of place k stands from that of place 0."""
    one, other = (place(0)[part == "tool"], place(k)[part == "tool"])
    D = inverse(one) @ other
    return 1e3 * np.linalg.norm(D[:3, 3]), np.degrees(np.linalg.norm(log_so3(D[:3, :3])))


def said(folder, visits, *sessions):
    read = read_session(written(folder, visits, *sessions), ROBOT)
    with pytest.raises(InputError) as error:
        calibrate(ROBOT, read, GEOMETRIC)
    assert error.value.code == "M35"
    return str(error.value)


@pytest.mark.parametrize("wrong", ["base", "tool"])
@pytest.mark.parametrize("both", [False, True], ids=["one shared", "both shared"])
def test_the_part_that_is_not_shared_is_named_with_how_far_it_is_off(tmp_path, wrong, both):
    right = "tool" if wrong == "base" else "base"
    visits = {"a": visit(0, 30), "b": visit(1, 30, **({right: 0} if both else {}))}
    lines = SAME.values() if both else [SAME[wrong]]
    text = said(tmp_path, visits, session("a"), session("b", *lines))
    length, angle = off(1, wrong)
    found = text.partition("(")[2].partition(")")[0].replace(" mm", "").replace(" deg", "")
    # links that are free move a base by a tenth of a millimeter, and three digits are told
    np.testing.assert_allclose([float(n) for n in found.split(", ")], [length, angle], rtol=6e-3)
    assert f'session "b" does not share the {wrong} of "a"' in text
    assert f'write {wrong} = "free" in "b"' in text


def test_both_parts_and_one_of_several_sessions_are_named(tmp_path):
    visits = {"a": visit(0, 30), "b": visit(1, 30, tool=0), "c": visit(2, 30)}
    text = said(
        tmp_path, visits, session("a"), session("b", SAME["tool"]), session("c", *SAME.values())
    )
    assert 'session "c" does not share the base and the tool of "a" (' in text
    assert 'write base = "free" and tool = "free" in "c"' in text
    # two of them are wrong: the first one is told, and after it the other
    lines = session("b", *SAME.values()), session("c", *SAME.values())
    assert '"b" does not share the base of' in said(tmp_path, visits, session("a"), *lines)


def test_sessions_that_share_what_they_say_are_calibrated_though_residuals_are_large(tmp_path):
    """A model that does not hold, here by a noise stated far too small, is no other frame."""
    visits = {"a": visit(0, 30), "b": visit(1, 30, base=0, tool=0)}
    head = (
        'robot = "staubli_tx60"\n[frames]\neuler = "XYZ"\n'
        "[uncertainty]\nposition_um = 1\nrotation_mdeg = 0.5\n"
    )
    sessions = session("a"), session("b", *SAME.values())
    read = read_session(written(tmp_path, visits, *sessions, head=head), ROBOT)
    found = calibrate(ROBOT, read, GEOMETRIC)
    assert found.fit.noise_factor > 5  # so that it was asked


def test_reflectors_of_unknown_place_that_were_mounted_anew_are_found(tmp_path):
    """They stand for the tool: its frame is not seen, so no figure is given."""
    a, b = visit(0, 30), visit(1, 30, tool=0)
    head = "[points]\n[uncertainty]\nposition_um = 20\n"
    for arms, wrong in ((ARMS, False), (1.5 * ARMS, True)):
        tables = {"a": points_of(a, ARMS, "ABC"), "b": points_of(b, arms, "ABC")}
        visits = {name: csv(table, form="{:.17g}") for name, table in tables.items()}
        sessions = session("a"), session("b", SAME["tool"])
        read = read_session(written(tmp_path, visits, *sessions, head=head), ROBOT)
        if not wrong:
            calibrate(ROBOT, read, GEOMETRIC)
            continue
        with pytest.raises(InputError, match='"b" does not share the tool of "a"; write tool'):
            calibrate(ROBOT, read, GEOMETRIC)
