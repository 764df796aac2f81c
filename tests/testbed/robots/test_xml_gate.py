"""What may not enter: bombs, outside files, broken or endless XML."""

import pytest

from calib.errors import InputError
from testbed.robots.describe.xml_gate import LARGEST, parse_xml, read_xml

LOL = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "{}">]>'.format("&a;" * 10)


def refused(data, root="robot"):
    with pytest.raises(InputError) as caught:
        parse_xml(data, root, where="x.urdf")
    return caught.value


def test_a_plain_file_passes_with_its_lines(tmp_path):
    path = tmp_path / "x.urdf"
    path.write_text('<robot name="a">\n<!-- note -->\n<link name="b"/></robot>')
    root = read_xml(path, "robot")
    assert root.get("name") == "a"
    assert root.find("link").sourceline == 3


@pytest.mark.parametrize("cut", [20, 30, 60])
def test_a_truncated_file_is_told_with_the_line_where_it_ends(cut):
    text = '<robot name="a">\n<link name="b"/>\n<link name="c"/>\n</robot>'
    error = refused(text[:cut].encode()) if cut < len(text) else refused(text[:-1].encode())
    assert error.code == "R1"
    assert error.where.startswith("x.urdf:")
    assert int(error.where.rpartition(":")[2]) == text[:cut].count("\n") + 1


@pytest.mark.parametrize(
    "doctype",
    [
        '<!DOCTYPE robot SYSTEM "{}">',
        '<!DOCTYPE robot [<!ENTITY x SYSTEM "{}">]>',
        '<!DOCTYPE robot [<!ENTITY % x SYSTEM "{}"> %x;]>',
        "<!DOCTYPE robot>",
    ],
)
def test_an_outside_entity_is_refused_and_its_text_never_shown(doctype, tmp_path):
    secret = tmp_path / "secret.txt"
    secret.write_text("TOP-SECRET")
    data = doctype.format(secret.as_uri()) + '<robot name="a">&x;</robot>'
    error = refused(data.encode())
    assert error.code == "R3"
    assert "TOP-SECRET" not in str(error)


def test_a_doctype_hidden_in_utf_16_is_found():
    assert refused((LOL + "<robot>&b;</robot>").encode("utf-16")).code == "R3"


def test_the_deepest_allowed_tree_passes():
    inner = 255
    root = parse_xml(
        b"<robot>" + b"<a>" * inner + b"</a>" * inner + b"</robot>", "robot", where="x"
    )
    assert root.tag == "robot"


def test_a_huge_file_is_refused_unread(tmp_path):
    path = tmp_path / "big.urdf"
    with path.open("wb") as file:
        file.truncate(LARGEST + 1)
    with pytest.raises(InputError, match="at most"):
        read_xml(path, "robot")


def test_a_missing_file_or_a_folder_is_our_error(tmp_path):
    for path in (tmp_path / "none.urdf", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            read_xml(path, "robot")
