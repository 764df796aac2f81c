"""Joint targets of a program, as a sheet: those of its moves, or if it has none, those declared."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from calib.errors import InputError
from testbed.files.refusal import refusal
from testbed.files.text import Sheet
from testbed.gates.text import FileText
from testbed.units import counted

ANOTHER = (
    "is assigned another value here, so its value at a move is known only while the program runs"
)
LOST = "only the controller knows the joint values there"
NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
CELL = re.compile(rf"\s*{NUMBER}\s*")
FEWEST = 4
"""Joints of a robot; shorter lists are something else."""


@dataclass(frozen=True, slots=True)
class Target:
    """Joint values as a program writes them."""

    line: int
    name: str
    """Its name; empty if it has none."""
    axes: tuple[str, ...]
    units: tuple[str, ...] = ()
    """Unit of each axis; degrees if empty."""
    beside: tuple[tuple[str, str], ...] = ()
    """Names and values of axes that are not the robot's."""


@dataclass(frozen=True, slots=True)
class JointList:
    """Joint targets of a program, and the number of its other moves."""

    sheet: Sheet
    aside: int = 0
    """Number of Cartesian positions that it moves to or has, whose joints no program states."""

    @property
    def note(self) -> tuple[str, ...]:
        """A sentence on moves that are not in the sheet."""
        if not self.aside:
            return ()
        moves = counted(self.aside, "Cartesian position")
        verb = "is" if self.aside == 1 else "are"
        return (f"joints: {moves} {verb} not used: {LOST}",)


@dataclass(slots=True)
class Program:
    """Declarations and moves of a program, read line by line."""

    text: FileText
    taught: str
    """Example of a joint target in this language."""
    elsewhere: str = ""
    """What to do where targets stand in another file, as this language keeps them."""
    declared: dict[str, Target] = field(default_factory=dict)
    """Joint targets by their names in small letters."""
    again: dict[str, int] = field(default_factory=dict)
    """Names that are assigned an unknown value, and the line of each."""
    tool: dict[str, int] = field(default_factory=dict)
    """Names of Cartesian positions, and the line of each."""
    moves: list[Target] = field(default_factory=list)
    aside: list[int] = field(default_factory=list)
    """Lines of the moves to Cartesian positions."""

    def statements(self, comment: str, *whole: str) -> Iterator[tuple[int, str]]:
        """Line and text of each statement, without what stands behind the mark of a comment.

        A line may have several with ; between them. Lines that begin with a `whole` mark are left
        out.
        """
        for number, line in self.text.content(comment, *whole):
            for statement in line.partition(comment)[0].split(";"):
                yield number, statement

    def place(self, line: int) -> str:
        """File and line."""
        return f"{self.text.where}:{line}"

    def declare(self, target: Target) -> None:
        """Add a named target; a name that exists already is noted in `again`."""
        name = target.name.lower()
        if name in self.declared:
            self.again.setdefault(name, target.line)
        self.declared[name] = target

    def assign(self, line: int, name: str, axes: tuple[str, ...], unit: str = "deg") -> None:
        """Give a name these joints; without any, it gets what is known only while running."""
        if axes:
            self.declare(Target(line, name, axes, (unit,) * len(axes)))
        else:
            self.again.setdefault(name.lower(), line)

    def move(
        self, line: int, verb: str, name: str, axes: tuple[str, ...], unit: str = "deg"
    ) -> None:
        """Add a move to what has a name, or to joints that the move writes as numbers."""
        if name:
            self.move_to(line, name)
        elif axes:
            self.moves.append(Target(line, "", axes, (unit,) * len(axes)))
        else:
            raise self.computed(line, verb)

    def move_to(self, line: int, name: str) -> None:
        """Add a move to a declared target, joints or a Cartesian position."""
        key = name.lower()
        if key in self.declared:
            self.moves.append(replace(self.declared[key], line=line, name=name))
        elif key in self.tool:
            self.aside.append(line)
        else:
            raise refusal(
                self.place(line), "joints",
                f'moves to "{name[:40]}", which is not declared before the move',
                fix=self.elsewhere or "declare it in the same file before the move, or remove the "
                "move",
            )  # fmt: skip

    def computed(self, line: int, verb: str) -> InputError:
        """The error of a move whose target is no list of numbers, and no name."""
        return refusal(
            self.place(line), "joints",
            f"{verb} has a computed target, whose joints are known only while the program runs",
            fix=f"write them as numbers: {self.taught}",
        )  # fmt: skip

    def relative(self, line: int, verb: str) -> InputError:
        """The error of a move by a difference."""
        return refusal(
            self.place(line), "joints",
            f"{verb} is a relative move, whose start is known only while the program runs",
            fix=f"write the joints that it reaches: {self.taught}",
        )  # fmt: skip

    def joints(self) -> JointList:
        """The targets of the moves, or if there are none, those declared.

        Raises
        ------
        InputError
            M35: there is none, one is assigned a value in the program, or the axes differ.
        """
        rows = self.moves or list(self.declared.values())
        used = {row.name.lower() for row in rows}
        if later := sorted((line, name) for name, line in self.again.items() if name in used):
            line, name = later[0]
            raise refusal(
                self.place(line), "joints", f"{name[:40]} {ANOTHER}",
                fix="write each position as its own target, or its numbers in the move",
            )  # fmt: skip
        if not rows:
            raise self._none()
        return JointList(sheet_of(self.text, rows), len(self.aside))

    def _none(self) -> InputError:
        """The error of a program without joints."""
        lines = self.aside or list(self.tool.values())
        if not lines:
            fix = f"give a program with joint targets: {self.taught}"
            return refusal(self.text.where, "joints", "has no joint target", fix=fix)
        return refusal(
            self.place(min(lines)), "joints",
            f"has {counted(len(lines), 'Cartesian position')} and no joint target: {LOST}",
            fix=f"write the joints at each stop in a table, or in the program: {self.taught}",
        )  # fmt: skip


def axes_of(listed: str | None) -> tuple[str, ...]:
    """Joints of a list with commas as a program writes it; none where it is not all numbers."""
    cells = (listed or "").split(",")
    if len(cells) < FEWEST or not all(map(CELL.fullmatch, cells)):
        return ()
    return tuple(map(str.strip, cells))


def sheet_of(text: FileText, rows: Sequence[Target]) -> Sheet:
    """Targets as a table ``pose_id, q1_deg ...``; without a name for each there is no pose_id.

    External axes that exist, and are not 0 throughout, become columns that are not read.

    Raises
    ------
    InputError
        M35: the axes differ.
    """
    kinds = {row.units or ("deg",) * len(row.axes) for row in rows}
    if len(kinds) > 1:
        fix = "split the file"
        raise refusal(text.where, "joints", "has targets of different robots", fix=fix)
    others = dict.fromkeys(name for row in rows for name, cell in row.beside if cell.strip("0.+-"))
    names = [row.name for row in rows]
    named = all(names) and len(set(names)) == len(names)
    head = [f"q{k + 1}_{unit}" for k, unit in enumerate(kinds.pop())] + list(others)
    cells = []
    for row in rows:
        beside = dict(row.beside)
        cells.append((*row.axes, *(beside.get(name, "") for name in others)))
    return Sheet(
        text.where,
        ("pose_id", *head) if named else tuple(head),
        tuple((name, *row) if named else row for name, row in zip(names, cells, strict=True)),
        tuple(row.line for row in rows),
        "comma",
        text.encoding,
    )
