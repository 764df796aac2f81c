"""The verb `iso9283`: its folder, its page, other kinds of files, clean ends."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbed.iso9283.figure_words import show
from testbed.iso9283.play import play_test
from testbed.iso9283.read import read_test
from testbed.iso9283.report import page_of
from testbed.iso9283.words import next_step
from testbed.scenario.systematic import SystematicTable
from tests.command import call
from tests.reported import printed_pages, read, said_twice
from tests.testbed.iso9283.made import SESSION, path_rows, pose_rows, text_of

STATED = SystematicTable(target_offset_um=5)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("iso9283")
    (folder / "cycles.csv").write_text(text_of(pose_rows(n=30)))
    (folder / "path.csv").write_text(text_of(path_rows(n=10)))
    (folder / "session.toml").write_text(SESSION)
    return folder


@pytest.fixture(scope="module")
def done(files):
    out = files / "out"
    return out, call("iso9283", files, "--out", out)


def test_the_command_writes_a_folder_and_says_what_came_out(done):
    out, result = done
    assert result.exit_code == 0, result.output
    names = {path.name for path in out.iterdir()}
    assert names == {
        "report.html", "result.json", "iso9283.csv", "job_sheet.csv", "test.npz", "iso9283.rrd"
    }  # fmt: skip
    lines = result.stdout.splitlines()
    assert lines[0] == "MEASURED - a test report, not a certificate; no traceability is claimed"
    assert any(line.startswith("Verdict: PASS at the stated limits.") for line in lines)
    assert lines[-2:] == [f"Report     {out / 'report.html'}", f"Next       truebed view {out}"]
    document = json.loads((out / "result.json").read_text())
    assert document["verdict"]["decision"] == "PASS"
    assert document["figures"]["AP"]["P1"]["value_um"] == pytest.approx(80, abs=1e-4)
    assert document["job"]["instrument"]["certificate"] == "K 1"
    assert any("out of date" in text for text in document["data"]["warnings"])
    assert document["standard"] == "ISO 9283:1998"


def test_the_page_has_every_section_and_keeps_what_users_wrote_as_text(done):
    html = (done[0] / "report.html").read_text()
    assert said_twice(html) == []
    assert "<h1>ISO 9283:1998: acceptance</h1>" in html
    for anchor in ("poses", "distances", "drift", "path-1", "data", "job", "record"):
        assert f'<section id="{anchor}">' in html, anchor
    assert "A &lt;b&gt;bold&lt;/b&gt; one" in html
    # every picture is there once more for a phone, which then has nothing to scroll through
    assert html.count('<div class="drawing twice">') == 3
    assert html.count("<svg") == 6
    assert "the text of the standard is not reproduced" in html
    assert not re.search(r"https?://(?!www\.w3\.org)", html)
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", html, flags=re.DOTALL).replace("finance", "")


def test_whoever_quotes_a_figure_reads_first_that_the_instrument_may_be_off(done):
    """That no systematic error is stated is no matter for a folded section alone."""
    first = (done[0] / "report.html").read_text().partition("Next step.")[2].partition("</p>")[0]
    assert "these limits are without systematic errors of the instrument" in first
    stated = replace(play_test(read_test(done[0].parent / "session.toml")).test, systematic=STATED)
    assert "without systematic" not in next_step(play_test(stated))


def test_a_test_prints_on_five_pages(done, tmp_path):
    assert printed_pages((done[0] / "report.html").read_text(encoding="utf-8"), tmp_path) <= 5


def test_the_page_says_micrometres_in_one_way_and_announces_no_empty_list(done):
    text = read((done[0] / "report.html").read_text()).said
    assert not [line for line in text if re.search(r"\bum\b", line)]
    # all runs of the path are alike: rounding is not printed as a length
    assert not [line for line in text if "× 10⁻" in line]
    assert any("RT of path line is < 0.001" in line for line in text)
    assert "Warnings:" not in text  # what it said stands in the verdict
    assert "60" in text  # the limit of RP, as it was given
    assert not [line for line in text if "limit 60.0" in line]


def test_all_figures_of_a_kind_have_the_same_decimals(files):
    result = play_test(read_test(files / "session.toml"))
    spreads = result.of("RD")
    # on both sides of the 9.95 um at which the second digit of u moves by one place
    between = [replace(f, u=u * 1e-6) for f, u in zip(spreads, (9.0, 10.5) * 5, strict=True)]
    typical = float(np.median([f.u for f in between]))
    alike = [replace(figure, typical_u=typical) for figure in between]
    assert len({show(f.value, f).partition(".")[2] != "" for f in alike}) == 1
    for name in {figure.name for figure in result.figures}:
        own = result.of(name)
        assert {f.typical_u for f in own} == {float(np.median([f.u for f in own]))}


def test_a_session_without_a_name_is_called_after_its_folder(files, monkeypatch):
    text = (files / "session.toml").read_text().replace('name = "acceptance"\n', "")
    folder = files / "press 4"
    folder.mkdir()
    for name in ("cycles.csv", "path.csv"):
        (folder / name).write_bytes((files / name).read_bytes())
    (folder / "session.toml").write_text(text)
    monkeypatch.chdir(folder)
    assert read_test(Path("session.toml")).name == "press 4"


@pytest.mark.slow
def test_the_same_files_give_the_same_bytes_and_nothing_is_written_over(done, files):
    out, _ = done
    again = files / "again"
    again.mkdir()
    (again / "iso9283.csv").write_text("older")
    over = call("iso9283", files, "--out", again)
    assert over.exit_code == 2
    assert "exists already" in over.output
    assert call("iso9283", files, "--out", again, "--quiet", "--overwrite").stdout == ""
    assert (files / "again.old-1" / "iso9283.csv").read_text() == "older"
    for name in ("report.html", "result.json", "iso9283.csv", "job_sheet.csv"):
        assert (out / name).read_bytes() == (again / name).read_bytes(), name


def test_bad_input_is_one_sentence_and_writes_nothing(files, tmp_path):
    (tmp_path / "one.csv").write_text(text_of(pose_rows(n=4)[:5]))
    result = call("iso9283", tmp_path / "one.csv", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert len(result.output.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
    document = call("iso9283", tmp_path / "one.csv", "--out", tmp_path / "out", "--json")
    assert json.loads(document.stdout)["error"]["code"] == "M27"


def test_a_workbook_is_the_same_test(files, tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    rows = pose_rows(n=5)
    sheet = book.active
    sheet.append(list(rows[0]))
    for row in rows:
        sheet.append(list(row.values()))
    book.save(tmp_path / "cycles.xlsx")
    (tmp_path / "cycles.csv").write_text(text_of(rows))
    one, two = (play_test(read_test(tmp_path / f"cycles.{end}")) for end in ("xlsx", "csv"))
    for a, b in zip(one.figures, two.figures, strict=True):
        assert a.value == pytest.approx(b.value, abs=1e-11)  # twelve digits in the CSV


def test_the_page_of_few_or_many_poses_is_drawn(tmp_path):
    """One pose has no distance, forty have more rows than a table."""
    (tmp_path / "a.csv").write_text(text_of([r for r in pose_rows(n=4) if r["pose_id"] == "P1"]))
    one = page_of(play_test(read_test(tmp_path / "a.csv")), {})
    assert [s.anchor for s in one.sections] == ["poses", "data", "record"]
    places = np.random.default_rng(0).uniform(400, 900, (70, 3))
    rows = pose_rows(n=4, bias=np.full((70, 3), 10.0), commands=places)
    (tmp_path / "b.csv").write_text(text_of(rows))
    many = play_test(read_test(tmp_path / "b.csv"))
    assert len(many.of("AD")) == 69
    page = page_of(many, {})
    assert len(page.sections[0].blocks[0].rows) == 60
    assert "10 more stand in iso9283.csv" in page.sections[0].blocks[0].note
