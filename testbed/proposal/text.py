"""A proposal as a TOML file with comments on evidence, assumptions and unused data."""

import shlex
from collections.abc import Sequence
from pathlib import Path

from testbed.files.columns import is_known
from testbed.proposal.data import Document, Found, files_of
from testbed.proposal.session import Proposed
from testbed.proposal.verdict import DROP
from testbed.proposal.wished import wished_lines
from testbed.toml_text import toml_lines, toml_value
from testbed.units import counted

MAY = """
# Further tables that a session may have:
# [drift]           nests = ["B1", "B2", "B3"]: targets that stay on the floor
# [conditions]      payload_kg, tool, temperature_degC and date of all rows
# [tolerance]       position_um: how far the tool may miss; rule = "guarded" or "simple"
# [tool_in_use]     point_mm = [x, y, z] in the flange: the tool that will be used, if it is another
# [prior]           length_mm, angle_deg: how far the links may lie from nominal (k = 1)
# [identification]  model = "choose", base = "free", tool = "free"; free = "frames": no link number
# [cycles], [paths] file = "cycles.csv", of truebed iso9283; [iso9283] limits_um = { RP = 30 }
# [[session]]       of a robot measured several times: name, file, base and tool "same as" another
#
# The job sheet: printed, but for the days of the certificate, which are held against [conditions]
# [job]
# number = ""
# customer = ""
# serial_number = ""  # of the robot
# operator = ""
# data_rights = ""    # whose the data are, and who may see them
# [job.instrument]
# name = "laser tracker"
# serial_number = ""
# certificate = ""    # its number
# calibrated = "2026-01-31"
# valid_until = "2027-01-31"
# [job.ambient]
# temperature_degC = [20.0, 21.0]  # lowest and highest
# pressure_hpa = 1013
# humidity_percent = 45
"""


def session_text(
    proposed: Proposed,
    looks: Sequence[Found],
    name: str,
    robot: str | None,
    model: str | None,
    tip: str | None = None,
    *,
    lacks_meshes: bool = False,
) -> str:
    """The text of a session.toml at path `name`; `robot` is the user's name for `model`."""
    verb = "iso9283" if proposed.is_test else "identify"
    files = ", ".join(f"{look.called} ({counted(look.rows, 'row')})" for look in looks)
    lines = [f"# Proposed by truebed new session from {files}", f"# {proposed.tried}."]
    if proposed.assumed:
        lines.append("# No file states these; change what is wrong:")
        lines += [f"#   {sentence}" for sentence in proposed.assumed]
    for title, told in (
        ("Not used", proposed.unused),
        ("Odd", proposed.odd),
        (f"To be corrected before {verb} takes these files", proposed.to_mend),
    ):
        if told:
            lines.append(f"# {title}:")
            lines += [f"#   {line}" for sentence in told for line in sentence.splitlines()]
    command = next_command(proposed, name, robot, tip, lacks_meshes=lacks_meshes)
    lines += [f"# Then: {command}", "format = 1"]
    lines += [f"name = {toml_value(called)}"] if (called := _called(looks, name)) else []
    lines += [f"robot = {toml_value(model)}"] if model is not None else []
    for line in toml_lines(proposed.document):
        if line.startswith("["):
            lines += _unused(line.strip("[]"), proposed.document, looks)
        lines.append(line)
    return "\n".join(lines) + "\n" + MAY


def next_command(
    proposed: Proposed,
    name: str,
    robot: str | None,
    tip: str | None = None,
    *,
    lacks_meshes: bool = False,
) -> str:
    """The command to type next for a session.toml."""
    name, drop = shlex.quote(name), f" {DROP}" * proposed.drops
    if proposed.is_test:
        return f"truebed iso9283 {name}{drop}"
    arm = shlex.quote(robot) if robot is not None else "ROBOT"
    more = f" --tip {shlex.quote(tip)}" if tip else ""
    return f"truebed identify {arm} {name}{more}" + " --allow-missing-meshes" * lacks_meshes + drop


def _called(looks: Sequence[Found], name: str) -> str:
    """Name of the session: that of its data file, or of the folder of several."""
    files = {look.name for look in looks}
    alone = len(files) == 1
    return Path(files.pop()).stem if alone else Path(name).absolute().parent.name


def _unused(section: str, document: Document, looks: Sequence[Found]) -> list[str]:
    """A comment on unused columns of a section's file, once per file."""
    table = document.get(section)
    if not isinstance(table, dict) or (place := _place(table)) is None:
        return []
    sections = [each for each in document.values() if isinstance(each, dict)]
    mine = [each for each in sections if _place(each) == place]
    if table is not mine[0]:
        return []
    read = {own for each in mine for own in each.get("columns", {}).values()}
    read |= {
        own for each in mine for columns in each.get("targets", {}).values() for own in columns
    }
    look = next((one for one in looks if (one.name, one.sheet) == place), None)
    if look is None or look.kind in ("points", "frames", "program"):
        return []
    said, known = wished_lines(look) if section != "cycles" else ([], set[str]())
    left = [name for name in look.head if name not in read | known and not is_known(name)]
    told = [f"not used: {', '.join(map(toml_value, left))}"] if left else []
    return [f"# {line}" for line in (*said, *told)]


def _place(table: Document) -> tuple[str, str | None] | None:
    """The first file of a table, and its sheet; None if it names none."""
    names = files_of(table)
    return (names[0], table.get("sheet")) if names else None
