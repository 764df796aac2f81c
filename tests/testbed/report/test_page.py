"""A page says each sentence once, where it is read first, and shows no empty section."""

from testbed.report.page import Figure, Page, Points, Section, Table, Text, render, said_once
from tests.reported import read, said_twice

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
