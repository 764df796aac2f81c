"""A page says each sentence once, where it is read first, and shows no empty section."""

import re
from dataclasses import replace

import pytest

from testbed.cli import handout
from testbed.report.page import (
    LONG,
    PRINTED,
    Figure,
    Page,
    Points,
    Section,
    Table,
    Text,
    printed,
    render,
    said_once,
)
from tests.reported import printed_pages, read, said_twice

FIRST, SECOND = "The region holds 5 um at 95 %.", "It rests on what was measured."


def page(*sections, picture=None):
    table = Table("caption", ("a", "b"), (("1", "2"),))
    return Page("banner", "title", "subtitle", True, "mark", FIRST, (SECOND,), table,
                "Measure once more.", sections, picture=picture)  # fmt: skip


def test_what_the_first_screen_says_is_left_out_of_the_sections():
    # units and spaces may be set otherwise there
    again = "The region holds 5\u202fµm at 95\u202f%."
    own = "Nobody else says so."
    made = page(
        Section("one", "One", (Text(f"{again} {own}"), Points((SECOND, "A short.", "A short.")))),
        Section("two", "Two", (Text(own), Points((SECOND,)))),
    )
    (only,) = said_once(made).sections
    assert only.blocks == (Text(own), Points(("A short.", "A short.")))
    assert said_twice(render(made)) == []
    assert said_twice("<p>Banner</p><p>It is so here.</p><p>It is so here. And there.</p>") == [
        "It is so here."
    ]


def test_a_line_that_announces_a_list_goes_with_it():
    made = page(Section("one", "One", (Text("Warnings:"), Points((SECOND,)), Text("The rest."))))
    (only,) = said_once(made).sections
    assert only.blocks == (Text("The rest."),)
    kept = page(Section("one", "One", (Text("Warnings:"), Points(("Another one was heard.",)))))
    assert [type(block) for block in said_once(kept).sections[0].blocks] == [Text, Points]


def test_a_section_that_gives_its_only_figure_to_the_first_screen_is_gone():
    figure = Figure("A curve.", "<svg></svg>")
    text = " ".join(read(render(page(Section("one", "Alone", (figure,))))).text)
    assert "A curve." in text
    assert "Alone" not in text
    kept = render(page(Section("one", "Kept", (figure, Text(FIRST + " And more.")))))
    assert "Kept" in kept
    assert "And more." in kept


def long_table(rows, **look):
    return Table(
        "Rows", ("name", "value"), tuple((f"row {k}", str(k)) for k in range(rows)), **look
    )


def test_print_says_what_it_leaves_to_the_file_and_says_nothing_where_it_leaves_nothing():
    figure = Figure("A curve.", "<svg></svg>")
    sections = (
        Section("one", "Kept", (figure, long_table(30, on_paper=10), long_table(3, on_paper=0))),
        Section("two", "Bends", (Text("It bends."),), on_paper=False),
        Section("three", "Drawn", (Text("Both."), replace(figure, on_paper=False))),
    )
    html = render(page(*sections))
    text = " ".join(read(html).text)
    left = "Not printed, but in report.html: Bends, 1 figure, 1 table and the end of 1 long table."
    assert left in text
    assert "and 20 more" in text
    assert html.count('class="more"') == 20
    for name in ("row 29", "row 2", "It bends."):  # the file has all of it
        assert name in text
    whole = (Section("one", "Kept", (figure, long_table(30))), Section("two", "B", (Text("It."),)))
    assert "Not printed" not in render(page(*whole))


def test_of_long_tables_print_shows_the_first_rows():
    assert [printed(count) for count in (1, PRINTED, LONG)] == [None] * 3
    assert printed(LONG + 1) == PRINTED


@pytest.mark.skipif(handout.browser() is None, reason="no browser prints pages")
def test_rows_and_sections_that_are_left_to_the_file_take_no_paper(tmp_path):
    def pages(*sections):
        return printed_pages(render(page(*sections)), tmp_path)

    assert pages(Section("one", "One", (long_table(300),))) > 3
    assert pages(Section("one", "One", (long_table(300, on_paper=10),))) == 1
    assert pages(Section("one", "One", (long_table(300, on_paper=0),))) == 1
    assert pages(Section("one", "One", (long_table(300),), on_paper=False)) == 1


@pytest.mark.skipif(handout.browser() is None, reason="no browser prints pages")
def test_two_narrow_tables_and_two_half_figures_stand_beside_each_other_on_paper(tmp_path):
    """Twenty pairs take half the paper of what has to stand alone."""
    narrow = long_table(12)
    assert narrow.is_narrow
    words = tuple((f"a long text of its own number {k}" * 2, str(k)) for k in range(12))
    wide = replace(narrow, rows=words)
    assert not wide.is_narrow
    svg = '<svg viewBox="0 0 400 200"><path d="M0 0L400 200"/></svg>'
    half = [Figure(f"Curve {k}.", svg, "half") for k in range(40)]
    apart = [block for figure in half for block in (figure, Text("Between."))]

    def pages(blocks):
        first = Figure("On the first screen.", svg)
        return printed_pages(
            render(page(Section("one", "One", tuple(blocks)), picture=first)), tmp_path
        )

    assert pages([narrow] * 20) < 0.7 * pages([wide] * 20)
    assert pages(half) < 0.7 * pages(apart)


def test_the_banner_at_the_end_follows_how_it_was_made_and_never_stands_alone_on_a_sheet():
    """A browser keeps what may not be parted together only where it has the same parent."""
    made = page(Section("record", "How it was made", (Text("Seed 1."),)))
    html = render(made)
    assert html.split("<body>")[1].rstrip().endswith("</footer>\n</main>\n</body>\n</html>")
    assert "</section>\n<footer" in html
    assert re.search(r"footer\.banner \{[^}]*break-before: avoid", html)


def test_the_banner_has_an_edge_all_around():
    """On a screen and on paper; what paper changes is no edge."""
    style = render(page()).partition("<style>")[2].partition("</style>")[0]
    banners = re.findall(r"(?m)^\s*(?:footer)?\.banner \{([^}]*)\}", style)
    assert "border: 2px solid" in banners[0]
    assert not any("border-" in banner for banner in banners)


def test_a_screen_reader_is_told_of_which_row_a_number_is_and_a_caption_once():
    table = Table("Errors", ("trial", "mm"), (("one", "1"), ("", "2")))
    figure = Figure("A curve.", "<svg></svg>")
    html = render(page(Section("one", "One", (figure, table))))
    assert '<table aria-label="Errors">' in html
    assert '<th scope="row" class="l">one</th><td class="r">1</td>' in html
    assert '<td class="l"></td><td class="r">2</td>' in html  # goes on with the row above
    assert html.count("A curve.") == 1


@pytest.mark.parametrize(
    ("mark", "believable", "look"),
    [
        ("✓ Believed", True, "good"),
        ("? Tested by nothing", True, "open"),
        ("? Tested by nothing", False, "bad"),
        ("✗ Refuted", True, "bad"),
    ],
)
def test_what_nothing_has_tested_does_not_look_like_what_was(mark, believable, look):
    html = render(replace(page(), mark=mark, believable=believable))
    assert f'<section class="verdict {look}">' in html
