"""Every message on a table of cycles, word for word: one case or more per kind of bad input."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from calib.errors import InputError
from testbed.files.read import ReadOptions
from testbed.iso9283.play import play_test
from testbed.iso9283.read import read_test
from testbed.iso9283.words import reasons
from tests.golden.words import assert_as_written
from tests.testbed.iso9283.made import changed, dropped, path_rows, pose_rows, text_of


def without(rows, *names):
    return [{k: v for k, v in row.items() if k not in names} for row in rows]


def scaled(rows, factor):
    return [row | {f"{a}_mm": row[f"{a}_mm"] * factor for a in "xyz"} for row in rows]


def shifted(rows):
    return [row | {"x_mm": row["x_mm"] + 1200.0} for row in rows]


def moved(rows, shift):
    """Readings beside the commands of other rows."""
    later = [rows[(k + shift) % len(rows)] for k in range(len(rows))]
    return [
        row | {f"{a}_mm": other[f"{a}_mm"] for a in "xyz"}
        for row, other in zip(rows, later, strict=True)
    ]


POSES, PATH = pose_rows(n=4), path_rows(n=4, m=6)
COMMANDS = ("command_x_mm", "command_y_mm", "command_z_mm")
FITTED = '[iso9283]\nframe = "fitted"\n'
CASES = {
    "one cycle only": (dropped(dropped(dropped(POSES, cycle=2), cycle=3), cycle=4), ""),
    "two cycles": (dropped(dropped(POSES, cycle=3), cycle=4), ""),
    "a pose measured once": (
        [row for row in POSES if row["pose_id"] != "P3" or row["cycle"] == 2], ""),
    "a pose measured twice": (
        [row for row in POSES if row["pose_id"] != "P3" or row["cycle"] < 3], ""),
    "cycles of different length": (dropped(POSES, pose_id="P4", cycle=3), ""),
    "several cycles that are not whole": (
        dropped(dropped(dropped(POSES, pose_id="P4", cycle=3), pose_id="P1", cycle=3),
                pose_id="P2", cycle=1), ""),
    "no cycle is whole often enough": (
        dropped(dropped(POSES, pose_id="P4", cycle=3), pose_id="P1", cycle=2), "drop"),
    "a cycle twice": (changed(POSES, {"cycle": 2}, pose_id="P2", cycle=3), ""),
    "a cycle that is no number": (changed(POSES, {"cycle": "x"}, pose_id="P2", cycle=3), ""),
    "a cycle that is half": (changed(POSES, {"cycle": 2.5}, pose_id="P2", cycle=3), ""),
    "times that go backwards": (changed(POSES, {"time_s": 1.0}, pose_id="P2", cycle=3), ""),
    "no commanded pose": (without(POSES, *COMMANDS), ""),
    "a commanded axis is missing": (without(POSES, COMMANDS[1]), ""),
    "a command is empty": (changed(POSES, {COMMANDS[0]: ""}, pose_id="P2", cycle=3), ""),
    "one pose commanded to two places": (
        changed(POSES, {COMMANDS[0]: 905.0}, pose_id="P2", cycle=3), ""),
    "a pose without a name": (changed(POSES, {"pose_id": ""}, pose_id="P2", cycle=3), ""),
    "no readings": (without(POSES, "x_mm", "y_mm", "z_mm"), ""),
    "a reading is no number": (changed(POSES, {"x_mm": "lost"}, pose_id="P2", cycle=3), ""),
    "every shot missed": (
        [row | {"x_mm": 0, "y_mm": 0, "z_mm": 0} for row in POSES], "drop"),
    "a shot missed": (
        changed(POSES, {"x_mm": 0, "y_mm": 0, "z_mm": 0}, pose_id="P2", cycle=3), ""),
    "distances": (
        [{"pose_id": "P1", "cycle": k, "distance_mm": 1.0, "anchor": "A"} for k in range(4)], ""),
    "meters called millimeters": (scaled(POSES, 1e-3), ""),
    "millimeters beside commands in meters": (
        [row | {name: row[name] * 1e-3 for name in COMMANDS} for row in POSES], ""),
    "angles that nothing tells the order of": (
        [row | {"rx_deg": 10, "ry_deg": 20, "rz_deg": 30} for row in POSES], ""),
    "a commanded angle is missing": (
        [row | {"rx_deg": 10, "ry_deg": 20, "rz_deg": 30, "command_rx_deg": 10, "euler": "kuka"}
         for row in POSES], ""),
    "another frame": (shifted(POSES), ""),
    "readings one row further up": (moved(POSES, 1), ""),
    "readings two rows further down": (moved(POSES, -2), ""),
    "names of columns and no rows": (",".join(POSES[0]), ""),
    "a frame from a line of points": (PATH, FITTED),
    "a path point is missing": (dropped(PATH, path_point=3, cycle=2), ""),
    "path points that do not match": (
        [row | {"path_point": row["path_point"] + 1} if row["cycle"] == 2 else row for row in PATH],
        ""),
    "a path point without a number": (changed(PATH, {"path_point": ""}, path_point=2, cycle=1), ""),
    "a path of one point": (path_rows(n=4, m=1), ""),
    "a path that stands still": ([row | {COMMANDS[0]: 800.0} for row in PATH], ""),
    "a path that ends early": (
        [row | {"x_mm": min(row["x_mm"], 820.0) + 1e-3 * row["path_point"]}
         if row["cycle"] == 2 else row for row in PATH], ""),
    "times that go backwards on a path": (
        changed(PATH, {"time_s": 1.0}, path_point=4, cycle=3), ""),
    "readings of a path without numbers and commands": (without(PATH, "path_point"), ""),
    "a path without a name": (without(PATH, "path"), '[paths]\nfile = "a.csv"\n'),
    "a session without cycles": (POSES, "session"),
    "a file of commands that is not there": (
        without(POSES, *COMMANDS), '[cycles]\ncommanded = "none.csv"\n'),
    "a pose that is not among the commands": (
        without(POSES, *COMMANDS), '[cycles]\ncommanded = "sent.csv"\n'),
    "poses without a column of names": (without(POSES, "pose_id"), ""),
    "a point of a path that is commanded without a number": (
        without(PATH, *COMMANDS), '[paths]\nfile = "a.csv"\ncommanded = "half.csv"\n'),
    "readings of a path without numbers and cycles": (
        without(PATH, *COMMANDS, "path_point", "cycle"),
        '[paths]\nfile = "a.csv"\ncommanded = "line.csv"\n'),
    "a pose commanded twice": (
        without(POSES, *COMMANDS), '[cycles]\ncommanded = "twice.csv"\n'),
    "a limit of another name": (POSES, "[iso9283]\nlimits_um = {PA = 3}\n"),
    "a limit of nothing": (POSES, "[iso9283]\nlimits_um = {AP = 0}\n"),
    "a frame that means nothing": (POSES, '[iso9283]\nframe = "fit"\n'),
    "a speed above all": (POSES, "[iso9283]\nspeed_percent = 120\n"),
    "a misspelt column of commands": (
        [{("comand_x_mm" if k == COMMANDS[0] else k): v for k, v in row.items()} for row in POSES],
        ""),
}  # fmt: skip


@cache
def told(name):
    """The sentence of a case, with a short name for its folder."""
    rows, toml = CASES[name]
    with TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "a.csv").write_text(rows if isinstance(rows, str) else text_of(rows))
        sent = "pose_id,x_mm,y_mm,z_mm\nP1,900,0,700\n"
        (root / "sent.csv").write_text(sent)
        (root / "twice.csv").write_text(sent + "P1,900,0,700\n")
        line = "path,path_point,x_mm,y_mm,z_mm\nline,1,800,-50,600\nline,{},900,-50,600\n"
        (root / "line.csv").write_text(line.format(2))
        (root / "half.csv").write_text(line.format(1.5))
        data, config = root / "a.csv", None
        if toml not in ("", "drop"):
            config = root / "session.toml"
            config.write_text("format = 1\n" if toml == "session" else toml)
        if toml == "session":
            data, config = root, None
        options = ReadOptions(drop_invalid=toml == "drop")
        with pytest.raises(InputError) as found:
            play_test(read_test(data, config=config, options=options))
        return str(found.value).replace(folder, "DIR")


def test_every_message_is_word_for_word_as_it_was_read():
    texts = {name: told(name) for name in CASES}
    whole = "".join(f"{name}\n{text}\n\n" for name, text in texts.items())
    assert_as_written(whole, "iso_messages.txt")


def test_every_message_is_one_line_with_file_and_code():
    for name in CASES:
        text = told(name)
        assert len(text.splitlines()) == 1, name
        assert text.startswith(("DIR/", "a.csv", "none.csv", "twice.csv", "half.csv")), text
        assert text.endswith("]"), name


@pytest.mark.parametrize("rows", [POSES, PATH], ids=["poses", "path"])
def test_readings_that_are_the_commands_are_called_so(tmp_path, rows):
    """The columns of the commands taken for those of the readings; one other digit is enough."""
    same = [row | {f"{a}_mm": row[f"command_{a}_mm"] for a in "xyz"} for row in rows]
    other = [same[0] | {"x_mm": same[0]["x_mm"] + 1e-6}, *same[1:]]
    for table, expected in ((same, 1), (other, 0)):
        (tmp_path / "a.csv").write_text(text_of(table))
        found = [
            text for text in read_test(tmp_path / "a.csv").warnings if "no measurement" in text
        ]
        assert len(found) == expected


@pytest.mark.parametrize("off", [{"x_mm": 9999.999}, {"z_mm": 5000.0}, {"x_mm": 701.0}])
def test_one_shot_that_missed_is_named_and_is_no_wrong_unit(tmp_path, off):
    """However far it missed: by a millimeter, or by nine meters beside which nothing scatters."""
    rows = changed(pose_rows(n=10), off, pose_id="P5", cycle=3)
    (tmp_path / "a.csv").write_text(text_of(rows))
    said = " ".join(reasons(play_test(read_test(tmp_path / "a.csv"))))
    assert "ycle 3 of pose P5 strays further than normal scatter does" in said
