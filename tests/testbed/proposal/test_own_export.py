"""Tables with matrices and covariances, as a run exports them: nothing of them is lost unsaid."""

import tomllib

import numpy as np

from testbed.files.columns import MATRIX_COLUMNS, covariance_names
from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, columns, csv
from tests.testbed.proposal.test_session import data, proposed

SPREAD = np.diag([1e-5, 2e-5, 3e-5, 1e-4, 2e-4, 3e-4]) ** 2
SPREAD[0, 1] = SPREAD[1, 0] = 1e-10


def export():
    """Own names throughout, 21 entries of covariances that are no multiples of a unit matrix."""
    own = columns(data(), form="matrix")
    entries = SPREAD[np.triu_indices(6)]
    return own | dict(zip(covariance_names(), np.tile(entries, (len(data().q), 1)).T, strict=True))


def test_rotations_and_covariances_of_an_export_are_read(tmp_path):
    (tmp_path / "a.csv").write_text(csv(export()))
    said, text = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", "staubli_tx60")
    assert "uncertainty:" not in said
    assert "not used" not in text
    table = read_session(tmp_path / "session.toml", ROBOT).measurements
    assert table.is_pose.all()
    # fifteen digits of the file
    np.testing.assert_allclose(table.rotation, data().T[:, :3, :3], rtol=0, atol=2e-15)
    # repeatability of the joints comes on top, as no file says that it is in the numbers already
    own = read_session(tmp_path / "a.csv", ROBOT).measurements.covariance
    np.testing.assert_array_equal(table.covariance, own)
    assert "simulated" not in tomllib.loads(text)


def test_what_a_session_beside_the_file_says_of_its_origin_is_kept(tmp_path):
    (tmp_path / "a.csv").write_text(csv(export()))
    (tmp_path / "b.toml").write_text('simulated = true\n[frames]\nfile = "other.csv"\n')
    (tmp_path / "c.toml").write_text("no session = [")
    _, text = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", "staubli_tx60")
    assert "simulated" not in tomllib.loads(text)
    (tmp_path / "session.toml").unlink()
    (tmp_path / "b.toml").write_text(
        'simulated = true\n[joints]\nfile = "a.csv"\n[frames]\nfile = "a.csv"\n'
        '[uncertainty]\njoint_repeatability = "included"\n'
    )
    _, text = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", "staubli_tx60")
    assert tomllib.loads(text)["simulated"] is True
    assert tomllib.loads(text)["uncertainty"] == {"joint_repeatability": "included"}
    assert read_session(tmp_path / "session.toml", ROBOT).simulated


def test_columns_of_ours_that_nothing_reads_are_named(tmp_path):
    table = export()
    left = [*MATRIX_COLUMNS[:-1], covariance_names()[0]]
    table = {k: v for k, v in table.items()
             if k in left or k not in (*MATRIX_COLUMNS, *covariance_names())}  # fmt: skip
    (tmp_path / "a.csv").write_text(csv(table))
    said, text = proposed(tmp_path, [tmp_path / "a.csv"], "--robot", "staubli_tx60")
    assert "points" in tomllib.loads(text)
    sentence = f"a.csv: columns {', '.join(left)}"
    assert f"  unused   {sentence}\n" in said
    assert f"#   {sentence}\n" in text
