"""Other tools do the same work as truebed, or the table of their times would compare nothing."""

import pytest

from tests.bench.peers import PEERS, missing, ways


@pytest.mark.filterwarnings("ignore")  # of what other tools load
@pytest.mark.parametrize("tool", PEERS.values())
def test_a_peer_gives_what_truebed_gives(tool):
    if tool in missing():
        pytest.skip(f"{tool} is not installed")
    found = {way.work: way.check(way.run()) for way in ways() if way.tool in {tool, "truebed"}}
    # poses agree to rounding; fits end within a thousandth of the noise, 1e-5 m
    assert max(found.values()) < 1e-6
    assert len(found) == 4
