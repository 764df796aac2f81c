"""Link numbers in Craig's order under the names of the standard one: named, never taken."""

from dataclasses import replace

import numpy as np
import pytest

from calib.errors import InputError
from testbed.files.alternatives import Interpretation
from testbed.files.probe import probe
from testbed.files.read import read_session
from testbed.files.tried.link_order import BEHIND, in_craigs_order
from testbed.robots.catalog import load_robot
from tests.testbed.files.made import columns, csv, made

M = 25


def in_the_wrong_order(arm):
    """A robot whose lines of links have what lies before their joints."""
    links = np.array(arm.model.chain.links)
    links[1:, BEHIND], links[0, BEHIND] = links[:-1, BEHIND], 0.0
    return replace(arm, model=replace(arm.model, chain=replace(arm.model.chain, links=links)))


@pytest.mark.parametrize("name", ["staubli_tx60", "kuka_iiwa7", "universal_ur10"])
@pytest.mark.parametrize("euler", ["XYZ", "ZYX"])
def test_craigs_order_is_named_whichever_way_the_rotations_turn(name, euler, tmp_path):
    """It ended with "is this the robot that was measured?", and rotations are tried later."""
    arm = load_robot(name)
    (tmp_path / "a.csv").write_text(csv(columns(made(seed=2, m=M, robot=arm), euler="ZYX")))
    (tmp_path / "s.toml").write_text(
        f'[frames]\neuler = "{euler}"\n[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n'
    )
    session = read_session(tmp_path / "a.csv", arm, config=tmp_path / "s.toml")
    with pytest.raises(InputError, match="move alpha_deg and a_mm up by one") as caught:
        probe(in_the_wrong_order(arm), session).raise_if_wrong()
    assert "(Craig's order, modified Denavit-Hartenberg)" in str(caught.value)
    assert caught.value.code == "M32"


def test_links_in_the_standard_order_are_left_alone(tmp_path):
    arm = load_robot("staubli_tx60")
    (tmp_path / "a.csv").write_text(csv(columns(made(seed=2, m=M), form="none")))
    (tmp_path / "s.toml").write_text("[points]\n[uncertainty]\nposition_um = 20\n")
    session = read_session(tmp_path / "a.csv", arm, config=tmp_path / "s.toml")
    table = session.measurements
    assert in_craigs_order(arm.model, Interpretation(table.q, table.position, None)) is None
    probe(arm, session).raise_if_wrong()
