"""Joint targets of a program: those of its moves, or else those that it declares, as a sheet."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from calib.errors import InputError
from testbed.files.refusal import refusal
from testbed.files.text import Sheet
from testbed.gates.text import FileText
from testbed.units import counted

ANOTHER = (
    "gets another value here than its numbers: which one a move has, only the running program knows"
)
LOST = "which joints the arm has there, only its controller knows"


@dataclass(frozen=True, slots=True)
class Target:
    """Joints as a program writes them."""

    line: int
    name: str
    """Empty where it has none."""
    axes: tuple[str, ...]
    units: tuple[str, ...] = ()
    """Of each axis; degrees if empty."""
    beside: tuple[tuple[str, str], ...] = ()
    """Axes that are none of the robot's, by their names."""


@dataclass(frozen=True, slots=True)
class JointList:
    """Joints of a program, and what else it moves to."""

    sheet: Sheet
    aside: int = 0
    """Moves to positions of the tool, whose joints no program says."""

    @property
    def note(self) -> tuple[str, ...]:
        """A sentence on moves that are no row."""
        if not self.aside:
            return ()
        moves = f"{counted(self.aside, 'move')} to positions of the tool"
        verb = "is" if self.aside == 1 else "are"
        return (f"joints: {moves} {verb} left aside: {LOST}",)


@dataclass(slots=True)
class Program:
    """What was met in a program so far, line by line."""

    text: FileText
    taught: str
    """How a target of joints is written in this language."""
    declared: dict[str, Target] = field(default_factory=dict)
    """By their names in small letters."""
    again: dict[str, int] = field(default_factory=dict)
    """Names that get a value that is not known here, and the line."""
    tool: dict[str, int] = field(default_factory=dict)
    """Names of positions of the tool, and the line of each."""
    moves: list[Target] = field(default_factory=list)
    aside: list[int] = field(default_factory=list)
    """Lines of the moves to positions of the tool."""

    def place(self, line: int) -> str:
        """File and line."""
        return f"{self.text.where}:{line}"

    def declare(self, target: Target) -> None:
        """Take a target that has a name; one that has it already gets another value."""
        name = target.name.lower()
        if name in self.declared:
            self.again.setdefault(name, target.line)
        self.declared[name] = target

    def move_to(self, line: int, name: str) -> None:
        """Move to what was declared, joints or a position of the tool."""
        key = name.lower()
        if key in self.declared:
            self.moves.append(replace(self.declared[key], line=line, name=name))
        elif key in self.tool:
            self.aside.append(line)
        else:
            raise refusal(
                self.place(line), "joints",
                f'moves to "{name[:40]}", of which there is no target before',
                fix="put its declaration into the same file, before the move, or take the move out",
            )  # fmt: skip

    def joints(self) -> JointList:
        """The targets of the moves, else those that are declared.

        Raises
        ------
        InputError
            M35: there is none, one gets its value while the program runs, or the axes differ.
        """
        rows = self.moves or list(self.declared.values())
        used = {row.name.lower() for row in rows}
        if later := sorted((line, name) for name, line in self.again.items() if name in used):
            line, name = later[0]
            raise refusal(
                self.place(line), "joints", f"{name[:40]} {ANOTHER}",
                fix="write each position as a target of its own, or its numbers into the move",
            )  # fmt: skip
        if not rows:
            raise self._none()
        return JointList(sheet_of(self.text, rows), len(self.aside))

    def _none(self) -> InputError:
        """The error of a program without joints."""
        lines = self.aside or list(self.tool.values())
        if not lines:
            fix = f"give a program with joints: {self.taught}"
            return refusal(self.text.where, "joints", "has no joint target", fix=fix)
        return refusal(
            self.place(min(lines)), "joints",
            f"has {counted(len(lines), 'position')} of the tool and no joint target: {LOST}",
            fix=f"write the joints at each stop into a table, or into the program: {self.taught}",
        )  # fmt: skip


def sheet_of(text: FileText, rows: Sequence[Target]) -> Sheet:
    """Targets as a table ``pose_id, q1_deg ...``; without a name for each there is no pose_id.

    External axes that are there, and not 0 throughout, become columns of which nothing is read.

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
