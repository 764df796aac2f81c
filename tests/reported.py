"""Small campaigns to report on, each played once per process, and how to read a page."""

import re
from collections import Counter
from contextlib import contextmanager
from dataclasses import fields
from functools import cache
from html.parser import HTMLParser
from unittest.mock import patch

import numpy as np

from testbed.cli import handout
from testbed.report.margins import Margins
from testbed.report.page import render
from testbed.run.derive import page_of
from testbed.scenario.read import changed
from testbed.studies import load_scenario
from tests import campaign

THOUSANDS = re.compile(r"(?<![\d.,])\d{4,}(?:\.\d+)?\s*[uµ]m\b|\de\+\d")
"""A thousand micrometers or more, in figures or as a power of ten."""
VERSIONS = {"truebed": "0.0.0", "numpy": "0"}
SMALL = {
    "pool.size": 160,
    "test.poses": 20,
    "uncertainty.repeats": 3,
    "uncertainty.replications": 10,
    "studies.random_sets": 30,
}


def played(name, changes):
    """A shipped scene with some keys changed, played."""
    return campaign.played(changed(load_scenario(name), changes))


def assert_same(one, other):
    """Two records of one class have equal fields, bit for bit."""
    for field in fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


@cache
def paper_campaign():
    """The scene wen2022 with every study, but a smaller pool and fewer replications."""
    return played("wen2022", SMALL)


@cache
def rigid_campaign():
    """The scene quick: a rigid robot, both estimators, no study but random sets."""
    return played("quick", {**SMALL, "uncertainty.replications": 40})


@cache
def bare_campaign():
    """One random trial, no study, no replication."""
    trial = [{"name": "only", "poses": 12, "method": "random"}]
    return played("quick", {**SMALL, "uncertainty.replications": 0, "trial": trial})


@cache
def point_campaign():
    """The scene position_only: one reflector, no paper mode."""
    return played("position_only", {**SMALL, "uncertainty.replications": 5})


@cache
def page(make):
    """The page of one of the campaigns above."""
    return page_of(make(), VERSIONS)


@cache
def html(make):
    """Its HTML."""
    return render(page(make))


@contextmanager
def undrawn():
    """Pages made within have empty figures: drawing is most of the work, and words are asked of."""

    def empty(figure, file, **named):
        file.write("<svg ></svg>")

    with patch("matplotlib.figure.Figure.savefig", empty), patch.object(Margins, "execute"):
        yield


VOID = frozenset({"meta", "br", "hr", "img", "link", "input"})


class Reader(HTMLParser):
    """Collects what tests ask of a page; complains about tags that are not closed in order."""

    def __init__(self):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.text, self.ids, self.links = [], [], [], [], []
        self.said = []  # as text, but nothing of figures

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in {"href", "xlink:href", "src"}:
                self.links.append(value)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if self.open.pop() != tag:
            raise ValueError(f"</{tag}> closes something else")

    def handle_data(self, data):
        if data.strip() and "style" not in self.open and "title" not in self.open:
            self.text.append(" ".join(data.split()))
            if "svg" not in self.open:
                self.said.append(self.text[-1])


def read(html):
    """A page, parsed."""
    reader = Reader()
    reader.feed(html)
    reader.close()
    return reader


def words(html):
    """How many words a page shows, folded sections and notes included, figures not."""
    return sum(len(text.split()) for text in read(html).said)


def pages(pdf):
    """How many pages a browser printed."""
    return len(re.findall(rb"/Type\s*/Page\b", pdf))


def printed_pages(html, folder):
    """How many sheets of A4 a browser makes of a page; 0 where none is there to print."""
    by, file = handout.browser(), folder / "report.html"
    if by is None:
        return 0
    file.write_text(html, encoding="utf-8")
    return pages(handout.print_pdf(file, by).read_bytes())


def said_twice(html):
    """Sentences of four words or more, up to a stop, that a page shows more than once."""
    said = read(html).said
    counts = Counter(
        sentence
        for text in said
        for sentence in re.split(r"(?<=[.!?]) (?=[A-Z])", text)
        if len(sentence.split()) >= 4 and sentence.endswith((".", "!", "?")) and sentence != said[0]
    )
    return [sentence for sentence, count in counts.items() if count > 1]
