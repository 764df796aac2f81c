"""Bars between a ball on the tool and sockets of unknown place, down to a ball in the socket."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from calib.geometry.jacobian import joint_columns
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from tests.testbed.files.made import ROBOT, csv, made

SOCKETS = np.array([[0.45, 0.25, 0.2], [0.2, -0.5, 0.25]])
EACH = 25


def measured(folder, length, sd=5e-6, written=None):
    """A session of bars of one length [m] between two sockets and the tool in many poses."""
    rng, data = np.random.default_rng(3), made(seed=2, m=4000)
    truth = replace(data.truth, chain=replace(data.truth.chain, T_world_base=np.eye(4)))
    columns, rows = joint_columns(truth.chain), {"q": [], "d": [], "anchor": []}
    for name, socket in zip("AB", SOCKETS, strict=True):
        away = truth.poses(data.q)[:, :3, 3] - socket
        q = data.q[np.argsort(np.abs(np.linalg.norm(away, axis=1) - length))[:EACH]]
        side = truth.poses(q)[:, :3, 3] - socket
        side /= np.linalg.norm(side, axis=1)[:, None]
        for _ in range(6):  # Newton's steps of the joints onto the ball about the socket
            T, J = truth.poses_and_jacobian(q)
            off = socket + length * side - T[:, :3, 3]
            q = q + (np.linalg.pinv(J[:, :3, columns]) @ off[:, :, None])[:, :, 0]
        rows["q"].append(q)
        d = np.linalg.norm(truth.poses(q)[:, :3, 3] - socket, axis=1)
        assert np.abs(d - length).max() < 1e-9
        rows["d"].append(np.abs(d + sd * rng.normal(size=EACH)))
        rows["anchor"] += [name] * EACH
    table = {f"q{k + 1}_deg": q for k, q in enumerate(np.degrees(np.vstack(rows["q"])).T)}
    d = 1e3 * np.concatenate(rows["d"])
    table |= {"anchor": rows["anchor"], "distance_mm": d if written is None else [written] * len(d)}
    (folder / "d.csv").write_text(csv(table))
    (folder / "session.toml").write_text(
        '[joints]\nfile = "d.csv"\n[ranges]\nfile = "d.csv"\n'
        'anchors_mm = { A = "free", B = "free" }\n[uncertainty]\ndistance_um = 5\n'
        '[identification]\nmodel = "geometric"\n'
    )
    return read_session(folder, ROBOT)


def test_bars_of_one_length_find_both_sockets(tmp_path):
    """Their lengths do not differ, which was taken for a wrong unit: "no answer at all"."""
    session = measured(tmp_path, 0.15)
    found = probe(ROBOT, session)
    assert found.stated.position < 1e-3
    found.raise_if_wrong()
    found = calibrate(ROBOT, session, Options(seed=1))
    assert found.converged
    fit = found.fit.identification
    # links that no distance tells stay nominal: the sockets take a part of them
    away = np.linalg.norm(fit.model.fixtures.anchors - SOCKETS, axis=1)
    assert away.max() < 1e-3


@pytest.mark.parametrize("length", [0.0, 5e-4])
def test_distances_too_short_to_point_anywhere_are_refused_with_the_reason(length, tmp_path):
    """A ball in its socket: 200 steps did not end, or ended in a wrong valley."""
    found = probe(ROBOT, measured(tmp_path, length))
    with pytest.raises(InputError, match=r"and not to which side of it it is off") as caught:
        found.raise_if_wrong()
    assert "put a bar of known length (50 mm or more) between both" in str(caught.value)


def test_distances_of_nothing_but_zero_are_no_missed_shots(tmp_path):
    with pytest.raises(
        InputError, match=r"has no distance but 0: .* a ball in a socket is no dist"
    ):
        measured(tmp_path, 0.0, written=0)
