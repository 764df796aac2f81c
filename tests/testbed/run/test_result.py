"""A result.json that is not what a run wrote: refused by file and place, whoever reads it."""

import json
import os

import pytest

from calib.errors import InputError
from testbed.run.result import SHAPE, equal_runs, read_result
from testbed.store import layout
from testbed.store.manifest import manifest_bytes
from tests.command import call
from tests.testbed.studies.trial.fake_campaign import FakeCampaign, FakeTrial, result, scenario

WHOLE = result(FakeCampaign(scenario(), None, (FakeTrial("a", None, 0.5),))) | {"failed": {}}
AGAIN = "write it again by `truebed report RUN`. [D42]"


@pytest.fixture
def run(tmp_path):
    """A run folder with a manifest and the result.json that is given."""
    (tmp_path / layout.MANIFEST).write_bytes(manifest_bytes({"scenario_sha256": "0" * 64}))

    def write(document):
        text = document if isinstance(document, str) else json.dumps(document)
        (tmp_path / layout.RESULT).write_text(text)
        return tmp_path

    return write


def places(document, shape=SHAPE, path=()):
    """Every place of a whole document that the shape names."""
    for name in document if "*" in shape else shape:
        inner = shape.get(name, shape.get("*"))
        yield (*path, name)
        if isinstance(inner, dict):
            yield from places(document[name], inner, (*path, name))


def with_value(path, value):
    """A copy of the whole document with another value, or without any."""
    document = json.loads(json.dumps(WHOLE))
    *tables, name = path
    table = document
    for key in tables:
        table = table[key]
    if value is Ellipsis:
        del table[name]
    else:
        table[name] = value
    return document


PLACES = [path for path in places(WHOLE) if path[-1] not in ("a", "whitened")]


def test_a_whole_result_is_read(run):
    assert read_result(run(WHOLE)) == WHOLE


@pytest.mark.parametrize("path", PLACES, ids=".".join)
def test_what_is_missing_or_of_another_type_is_named(run, path):
    for value in (..., [], "x" if not isinstance(at(path), str) else 1, True):
        if value is True and isinstance(at(path), bool):
            continue
        folder = run(with_value(path, value))
        with pytest.raises(InputError) as caught:
            read_result(folder)
        told = str(caught.value).replace(str(folder), "RUN")
        assert told.startswith(f"RUN/result.json: is damaged: {'.'.join(path)} is ")
        assert told.endswith(AGAIN)


def at(path):
    value = WHOLE
    for name in path:
        value = value[name]
    return value


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (json.dumps(WHOLE | {"format": 2}), "has format 2; this version reads format 1; install a"),
        (json.dumps(WHOLE | {"format": True}), "is damaged: format is True; write it again"),
        (json.dumps(WHOLE | {"format": "1"}), "is damaged: format is '1'; write it again"),
        (json.dumps(WHOLE).replace("0.95", "NaN"), "is damaged: NaN is not a number that can"),
        (json.dumps(WHOLE).replace("0.95", "1e999"), "is damaged: 1e999 is not a number that can"),
        (json.dumps(WHOLE).replace("0.95", "9" * 4000), "is damaged: 99999999999999999999 is not"),
        ('{"format": 1, "format": 1}', "is damaged: duplicate key 'format'; write it again"),
        ("[" * 100_000, "is damaged: nested too deeply; write it again"),
        ("", "is damaged: Expecting value: line 1 column 1 (char 0); write it again"),
        ("[1]", "is damaged: not a JSON object; write it again"),
    ],
)
def test_compare_refuses_it_in_one_sentence_and_writes_nothing(run, text, told):
    folder = run(text)
    before = sorted(folder.iterdir())
    ended = call("compare", folder)
    assert (ended.exit_code, ended.stdout) == (2, "")
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f"{folder}/result.json: {told}")
    assert line.endswith(" [D42]")
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("name", [layout.RESULT, layout.MANIFEST, layout.ARRAYS])
def test_a_sparse_file_of_gigabytes_is_refused_unread(run, name):
    folder = run(WHOLE)
    with (folder / name).open("r+b" if (folder / name).exists() else "wb") as file:
        file.truncate(5 * 10**9)  # takes no room
    ended = call("compare", folder)
    assert ended.exit_code == 2
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f"{folder}/{name}: is damaged: it has 5000 MB")


def test_a_pipe_in_place_of_a_file_is_not_waited_for(run):
    folder = run(WHOLE)
    (folder / layout.RESULT).unlink()
    os.mkfifo(folder / layout.RESULT)
    with pytest.raises(InputError, match="is damaged: it is not an ordinary file"):
        read_result(folder)


def test_runs_without_arrays_are_compared_by_their_results(run, tmp_path):
    assert equal_runs([run(WHOLE), tmp_path]) == [[tmp_path, tmp_path]]
