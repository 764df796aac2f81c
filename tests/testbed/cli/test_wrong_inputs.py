"""What people give by mistake: one sentence says what is wrong, where, and what to do."""

import numpy as np
import pytest

from tests.command import call
from tests.testbed.files.made import columns, csv, made

SESSION = '[joints]\nfile = "a.csv"\n[frames]\nfile = "a.csv"\n'


def said(*words):
    done = call(*words)
    assert done.exit_code == 2, done.output
    (line,) = done.stderr.splitlines()
    return line


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = columns(made(), form="none") | {f"u{axis}_mm": [0.02] * 29 for axis in "xyz"}
    (tmp_path / "a.csv").write_text(csv(rows))
    (tmp_path / "s.toml").write_text(SESSION)
    (tmp_path / "other.toml").write_text(SESSION)
    (tmp_path / "data.json").write_text("{}")
    (tmp_path / "links.csv").write_text("a,b\n1,2\n")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "session.toml").write_text(SESSION)
    (tmp_path / "head.csv").write_text("pose_id,x_mm\n")
    mixed = {name: rows[name] for name in rows if name != "x_mm"}
    mixed |= {"x_m": (np.array(rows["x_mm"], dtype=float) / 1e3).tolist()}
    (tmp_path / "mixed.csv").write_text(csv(mixed))
    radians = {name.replace("_deg", "_rad"): values for name, values in rows.items()}
    del radians["q6_rad"]
    (tmp_path / "five.csv").write_text(csv(radians))
    (tmp_path / "scene.toml").write_text(
        'format = 1\nname = "a"\nrobot = "gone.toml"\n[[trial]]\nname = "a"\nmethod = "random"\n'
        "poses = 20\n"
    )
    return tmp_path


TX60 = "staubli_tx60"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["identify", TX60, "s.toml", "--config", "other.toml"], "s.toml: says itself how its f"),
        (["identify", TX60, "s.toml", "--mesh-root", "."], "lie beside it; leave the mesh root"),
        (["identify", TX60, "mixed.csv"], "have different units; give them in one unit. [M35]"),
        (["identify", TX60, "five.csv"], "1 of the 6 joints of staubli_tx60; needed: q6_rad;"),
        (["identify", TX60, "data.json"], "data.json: holds no records that make a table; "),
        (["iso9283", "s.toml", "--config", "other.toml"], "--config is given; leave one of them"),
        (["new", "session", "a.csv", "a.csv"], "a.csv: is given twice; give each file once. [S"),
        (["check", "scene.toml"], "scene.toml: there is no robot"),
        (["check", "data.json"], "data.json: holds no records that make a table; "),
        (["check", "head.csv"], "head.csv: names its columns and has no rows below them;"),
        (["check", "a.csv", "--robot", "kuka_iiwa7"], "no column for 1 of the 7 joints of kuka"),
        (["run", "coverage", "--slice", "1/2", "--overwrite"], "a slice is one of several that"),
        (["run", "coverage", "--slice", "1/2", "--export", "b"], "give --export with the run"),
        (["identify", "links.csv", "a.csv"], "links.csv: is a table, and a robot is wanted here"),
        (["run", "quick", "--export", "full"], "choose another --export, or rename the old one"),
        (["run", "quick", "--out", "b", "--export", "b"], "--export b is --out, too; choose anoth"),
        (["merge", "a", "a", "--out", "b"], "a: is given twice; give each folder once. [C41]"),
    ],
)
def test_it_is_said_in_one_sentence(words, told, here):
    before = sorted(here.rglob("*"))
    assert told in said(*words)
    assert sorted(here.rglob("*")) == before  # and nothing was written


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("[uncertainty]\nposition_mm = 0.01", 'has no key "position_mm"; write position_um = 10.'),
        ("[uncertainty]\nnoise_um = 10", 'has no key "noise_um"; write position_um = 10. [S37]'),
        (
            '[identification]\nfree = "wen2021"',
            'a list of names of numbers; did you mean "wen2022"?',
        ),
        ("[conditions]\ntemperature_degC = 293", "is 293; it must be 150 degC or smaller;"),
        ('[drift]\nnests = ["B1"]', "has no row of a nest, and [drift] names B1; name what each"),
        ('[uncertainty]\nposition_um = 9\n[points]\nfile = "aa.csv"', 'did you mean "a.csv"? [M'),
    ],
)
def test_a_key_of_a_session_that_is_not_meant_so_is_mended_in_the_message(lines, told, here):
    seen = "" if "[points]" in lines else '[points]\nfile = "a.csv"\n'
    (here / "s.toml").write_text(f'[joints]\nfile = "a.csv"\n{seen}{lines}\n')
    assert told in said("check", "s.toml", "--robot", TX60)


def test_a_table_that_would_not_be_read_is_refused(here):
    """Who gives an old session to a new table must not be handed the result of the old one."""
    (here / "new.csv").write_text((here / "a.csv").read_text())
    (here / "s.toml").write_text(SESSION.replace("frames", "points"))
    line = said("identify", TX60, "new.csv", "--config", "s.toml", "--out", "out")
    assert line == (
        "new.csv: would not be read: s.toml names a.csv itself; take file = out of s.toml, or give "
        "s.toml in place of new.csv. [C41]"
    )
    for key, kind in (("points", "readings"), ("joints", "joints")):
        (here / "s.toml").write_text(f'[{key}]\nfile = "a.csv"\n[uncertainty]\nposition_um = 9\n')
        line = said("identify", TX60, "new.csv", "--config", "s.toml", "--out", "out")
        assert f"new.csv: has {kind} of its own, and [{key}] takes those of a.csv; take" in line
    assert not (here / "out").exists()
    rows = [f"P,{cycle},{cycle / 100},0,0,0,0,0" for cycle in range(30)]
    table = "pose_id,cycle,x_mm,y_mm,z_mm,command_x_mm,command_y_mm,command_z_mm"
    for name in ("old.csv", "cycles.csv"):
        (here / name).write_text("\n".join([table, *rows]))
    (here / "iso.toml").write_text('[cycles]\nfile = "old.csv"\n')
    line = said("iso9283", "cycles.csv", "--config", "iso.toml")
    assert "cycles.csv: would not be read: iso.toml names old.csv itself;" in line
    # a session that names the table itself reads it
    done = call("iso9283", "old.csv", "--config", "iso.toml", "--quiet")
    assert done.exit_code == 0, done.output


def test_a_wrong_file_is_named_before_a_session_that_exists(here):
    (here / "session.toml").write_text(SESSION)
    assert said("new", "session", "gone.csv").startswith("gone.csv: does not exist")
    assert said("new", "session", "a.csv").startswith("session.toml: exists already")


def test_a_command_to_type_can_be_pasted_whatever_the_name(here):
    rows = columns(made(), form="none")
    own = {f"Achse {name[1]}" if name[1:2].isdigit() else name: rows[name] for name in rows}
    (here / "my data.csv").write_text(csv(own))
    done = call("check", "my data.csv", "--robot", TX60)
    assert "truebed new session 'my data.csv' --robot" in done.stdout, done.output


def test_the_same_session_by_config_is_no_second_one(here):
    """Whoever names the file twice means one; it then reads as usual."""
    line = said("identify", TX60, "s.toml", "--config", "s.toml", "--out", "out")
    assert "--config" not in line
