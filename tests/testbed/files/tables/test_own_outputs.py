"""Files of this program among those of a user, as *.json names them: said, and left aside."""

import json

import numpy as np
import pytest

from testbed.files.read import read_session
from testbed.proposal.own_outputs import what_we_wrote
from testbed.schemas.editor import schema_beside
from testbed.store.manifest import manifest_bytes
from tests.command import call
from tests.testbed.proposal.test_odd_files import DATA, UR10
from tests.testbed.proposal.test_own_joints import RECORDS
from tests.testbed.proposal.test_session import proposed


@pytest.fixture
def ours(tmp_path):
    """The schema that `new session` wrote the day before, and two files of a run folder."""
    schema_beside(tmp_path / "session.toml", "session")
    (tmp_path / "manifest.json").write_bytes(manifest_bytes({"name": "quick"}))
    result = {"format": 1, "trials": [{"x": 1.0}, {"x": 2.0}], "truebed": "0.1.0"}
    (tmp_path / "result.json").write_text(json.dumps(result))
    return sorted(tmp_path.glob("*.json"))


def test_files_of_our_own_are_left_aside_and_named(ours, tmp_path):
    """Their objects were taken for tables: "holds several tables with the same names"."""
    data = tmp_path / "data.json"
    data.write_text(json.dumps(RECORDS["in an object"]))
    said, _ = proposed(tmp_path, [data, *ours], "--robot", UR10.name)
    wrote = "that truebed wrote, no measurements"
    assert f"session.schema.json: a JSON Schema for editors {wrote}" in said
    assert all(f"{name}.json: a result {wrote}" in said for name in ("manifest", "result"))
    table = read_session(tmp_path / "session.toml", UR10).measurements
    np.testing.assert_allclose(table.q, DATA.q, rtol=0, atol=1e-12)
    assert what_we_wrote(data) == ""


def test_files_of_our_own_alone_are_no_measurements(ours, tmp_path):
    done = call("new", "session", *ours, "--out", tmp_path / "session.toml")
    assert done.exit_code == 2
    said = " ".join(done.stderr.split())
    assert "are a result and a JSON Schema for editors that truebed wrote, no measurements" in said
    assert "a result that truebed wrote" in call("check", tmp_path / "result.json").stdout
