"""The documents: every key of every file is described, and pages only name what is there."""

import re
from pathlib import Path

import pytest

from made.fields import allowed_of, keys
from made.formats import FILES, described, page, places
from testbed.robots.links import Link
from testbed.scenario.laboratory import PaperTracker

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("file", FILES)
def test_every_key_of_every_file_is_described(file):
    silent = [
        f"{place or 'top'}: {key.name} ({model.__name__})"
        for model, place in places(file).items()
        for key in keys(model)
        if len(described(key)) < 4
    ]
    assert not silent


@pytest.mark.parametrize("file", FILES)
def test_every_key_with_a_number_states_its_unit_or_has_none(file):
    for model in places(file):
        for key in keys(model):
            if re.search(r"_(mm|um|deg|mdeg|kg|s|h|k|nm)$", key.name):
                assert key.unit, f"{model.__name__}.{key.name}"


def test_a_key_reads_as_its_schema_says():
    (position,) = (key for key in keys(PaperTracker) if key.name == "position_um")
    assert (position.unit, position.default) == ("µm", "`17.5`")
    assert position.allowed == "number, 1e-06 to 10000"
    assert position.meaning == "Standard deviation per axis."


def test_a_sentence_is_that_of_the_class_that_declares_the_field():
    class Inner(Link):
        kind: str = "inner"

    assert {key.name: key.meaning for key in keys(Inner)}["d_mm"].startswith("Offset along")


@pytest.mark.parametrize(
    ("schema", "words"),
    [
        ({"type": "number", "exclusiveMinimum": 0, "maximum": 9}, "number, above 0 and at most 9"),
        ({"anyOf": [{"type": "boolean"}, {"type": "null"}]}, "`true`, `false`"),
        ({"type": "array", "prefixItems": [{"type": "number"}] * 3}, "3 entries: number"),
        ({"type": "array", "items": {"type": "string"}}, "list: text"),
    ],
)  # fmt: skip
def test_what_is_allowed_in_words(schema, words):
    assert allowed_of(schema) == words


def test_every_link_on_a_format_page_has_its_end():
    for file in FILES:
        text = page(file)
        anchors = set(re.findall(r"^\((.*)\)=$", text, flags=re.MULTILINE))
        assert len(anchors) == len(places(file))
        assert set(re.findall(r"\]\(#(.*?)\)", text)) <= anchors
