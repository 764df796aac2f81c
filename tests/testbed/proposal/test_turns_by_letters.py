"""Rotations by letters that fix their order, and those in no order that is tried."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from testbed.files.read import read_session
from testbed.files.rotations import rotations, sequence_of
from testbed.proposal.data import look_at
from testbed.proposal.session import propose_session
from tests.testbed.files.made import ROBOT, columns, csv, made

M = 15


def proposed(folder, names, euler="ZYZ"):
    """What is proposed for joints, places and three angles in degrees under some names."""
    data = made(seed=2, m=M)
    whole = columns(data)
    table = {f"J{k + 1}": whole[f"q{k + 1}_deg"] for k in range(6)}
    table |= {axis.upper(): whole[f"{axis}_mm"] for axis in "xyz"}
    angles = Rotation.from_matrix(data.T[:, :3, :3]).as_euler(euler, degrees=True)
    table |= dict(zip(names, angles.T, strict=True))
    (folder / "d.csv").write_text(csv(table, form="{:.6f}"))
    return propose_session(look_at([folder / "d.csv"], folder), ROBOT, folder)


@pytest.mark.parametrize("names", ["OAT", ("A", "E", "R"), ("O[deg]", "A[deg]", "T[deg]")])
def test_letters_of_kawasaki_and_comau_are_turns_about_z_y_z(names, tmp_path):
    """They stood among the columns that are not used."""
    found = proposed(tmp_path, names)
    assert found.fits
    assert found.document["frames"]["euler"] == "ZYZ"
    own = [found.document["frames"]["columns"][f"e{k}_deg"] for k in (1, 2, 3)]
    assert own == list(names)
    assert not found.unused
    assert any("as turns about z, the turned y, the turned z" in one for one in found.assumed)


@pytest.mark.parametrize("named", ["{} ist [{}]", "{}_measured", "Messung {} ({})"])
def test_letters_beside_places_with_the_same_words_are_turns(named, tmp_path):
    """They stood among the columns that are not used, and the poses were read as points."""
    data = made(seed=2, m=M)
    whole = columns(data, euler="ZYX")
    table = {f"A{k + 1} [°]": whole[f"q{k + 1}_deg"] for k in range(6)}
    table |= {f"{axis} soll [mm]": 1e3 * data.q[:, k] for k, axis in enumerate("XYZ")}
    table |= {f"{letter} soll [°]": data.q[:, k] for k, letter in enumerate("ABC")}
    table |= {named.format(axis.upper(), "mm"): whole[f"{axis}_mm"] for axis in "xyz"}
    letters = {
        named.format(letter, "°"): f"r{axis}_deg" for letter, axis in zip("ABC", "zyx", strict=True)
    }
    table |= {name: whole[stem] for name, stem in letters.items()}
    (tmp_path / "d.csv").write_text(csv(table, form="{:.6f}"))
    found = propose_session(look_at([tmp_path / "d.csv"], tmp_path), ROBOT, tmp_path)
    assert found.fits
    assert found.document["frames"]["euler"] == "ZYX"
    theirs = found.document["frames"]["columns"]
    assert {theirs[stem]: stem for stem in letters.values()} == letters


def test_kawasaki_is_a_word_for_their_order(tmp_path):
    assert sequence_of("kawasaki", "") == "ZYZ"
    # O about z, A about the turned y, T about the turned z, as a product written out
    o, a, t = 0.3, 1.1, -0.4

    def about_z(x):
        return np.array([[np.cos(x), -np.sin(x), 0], [np.sin(x), np.cos(x), 0], [0, 0, 1]])

    about_y = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    expected = about_z(o) @ about_y @ about_z(t)
    np.testing.assert_allclose(rotations("ZYZ", [[o, a, t]])[0], expected, atol=1e-15)
    proposed(tmp_path, ("e1_deg", "e2_deg", "e3_deg"))
    (tmp_path / "session.toml").write_text(
        '[joints]\nfile = "d.csv"\n[joints.columns]\n'
        + "".join(f'q{k}_deg = "J{k}"\n' for k in range(1, 7))
        + '[frames]\nfile = "d.csv"\neuler = "kawasaki"\n'
        'columns = { x_mm = "X", y_mm = "Y", z_mm = "Z" }\n'
        "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n"
    )
    table = read_session(tmp_path, ROBOT).measurements
    # six decimals of a degree
    np.testing.assert_allclose(table.rotation, made(seed=2, m=M).T[:, :3, :3], atol=1e-7)


@pytest.mark.slow
def test_angles_in_an_order_that_is_not_tried_do_not_lose_the_places(tmp_path):
    """Nothing fitted, and what was proposed were these angles as XYZ."""
    found = proposed(tmp_path, ("yaw", "pitch", "roll"))
    assert found.fits
    assert "frames" not in found.document
    assert found.document["points"]["columns"] == {"x_mm": "X", "y_mm": "Y", "z_mm": "Z"}
    assert found.document["uncertainty"] == {"position_um": 30, "assumed": True}
    assert found.unused == ("d.csv: columns yaw, pitch, roll",)
    assert any(one.startswith("rotations: they fit in no order") for one in found.assumed)


@pytest.mark.parametrize(
    ("names", "euler", "read"),
    [
        (("alpha", "beta", "gamma"), "xyz", "ZYX"),
        (("α [°]", "β [°]", "γ [°]"), "XYZ", "XYZ"),
        (("psi", "theta", "phi"), "ZYX", "ZYX"),
    ],
)
def test_greek_letters_are_turns_about_the_axes_where_these_fit(names, euler, read, tmp_path):
    """They stood among the columns that are not used."""
    found = proposed(tmp_path, names, euler)
    assert found.fits
    assert found.document["frames"]["euler"] == read
    assert not found.unused


@pytest.mark.slow
def test_greek_letters_that_fit_in_no_order_are_left_aside_and_the_places_are_read(tmp_path):
    found = proposed(tmp_path, ("alpha", "beta", "gamma"), "ZYZ")
    assert found.fits
    assert "points" in found.document
    assert any("they fit in no order that is tried" in one for one in found.assumed)
