"""The errors this project raises: what is wrong, where, what was allowed and the likely fix."""

import re
from typing import Any, Self, TypeVar

E = TypeVar("E", bound="CalibError")

STEERING = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""What steers a terminal, ends a line or turns the direction of writing, and stray surrogates."""

LONGEST = 400
"""Characters of one part of a sentence: names and values in it may be endless."""

AMOUNT = re.compile(
    r"(?:at least|at most|one of|between|above|zero|a whole number|finite)\b"
    r"|-?\d\S*?(?: to -?\d\S*?)?(?: \w+)?(?: or (?:more|larger))?(?=$|[:;,])"
)
"""Beginning of a value or a range, which says nothing without a verb; numbers up to their unit."""
VERB = re.compile(
    r"\b(?:is|are|has|have|must|should|needs?|belongs?|holds?|gives?|rejects?|tells?)\b"
)


def visible(text: str) -> str:
    r"""A text with its control characters written out; line ends and tabs stay.

    Examples
    --------
    >>> print(visible("a\x1b[31m, b\u2028c"))
    a\x1b[31m, b\u2028c
    """
    return STEERING.sub(_written, text)


def one_line(text: str) -> str:
    r"""The same where a line end or a tab would be one too many.

    Examples
    --------
    >>> print(one_line("a\nb"))
    a\x0ab
    """
    return re.sub(r"[\n\t]", _written, visible(text))


def _written(found: re.Match[str]) -> str:
    """A character as Python's strings may write it."""
    number = ord(found[0])
    return f"\\x{number:02x}" if number < 256 else f"\\u{number:04x}"


def short(text: str) -> str:
    """A text of a length that people read: its beginning and its end.

    Examples
    --------
    >>> len(short("x" * 5000))
    405
    """
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 100]} ... {text[-100:]}"


def expectation(allowed: str) -> str:
    """What would have been accepted as a part of a sentence: a bare value or range gets its verb.

    Examples
    --------
    >>> expectation("0 to 299"), expectation("1 to 4: the data hold 5")
    ('expected 0 to 299', 'expected 1 to 4: the data hold 5')
    >>> expectation("every value must be finite"), expectation("2 to 3 times is usual")
    ('every value must be finite', '2 to 3 times is usual')
    """
    bare = AMOUNT.match(allowed) and not VERB.search(re.split("[:;]", allowed)[0])
    return f"expected {allowed}" if bare else allowed


class CalibError(Exception):
    """Base of every error that leaves a public function.

    Parameters
    ----------
    message : str
        The thing and its value, e.g. ``q[3, 1] is nan``.
    code : str
        Short stable identifier, e.g. ``A2`` or ``S37``.
    where : str
        File, file and line, or table; empty inside `calib`.
    field : str
        Name of the array, key or column.
    value : object
        What was found.
    allowed : str
        What would have been accepted.
    fix : str
        The likely remedy, as an imperative.
    """

    def __init__(
        self,
        message: str,
        *,
        code: str,
        where: str = "",
        field: str = "",
        value: object = None,
        allowed: str = "",
        fix: str = "",
    ) -> None:
        self.message = message
        self.code = code
        self.where = where
        self.field = field
        self.value = value
        self.allowed = allowed
        self.fix = fix
        super().__init__(str(self))

    def __str__(self) -> str:
        said = (self.message, expectation(self.allowed), self.fix)
        parts = (short(part) for part in said if part)
        body = "; ".join(parts)
        place = f"{self.where}: " if self.where else ""
        stop = "" if body.endswith(("?", ".", "!")) else "."
        return one_line(f"{place}{body}{stop} [{self.code}]")

    def __reduce__(self) -> tuple[Any, ...]:
        """From one process to another: the message alone would not make it again."""
        return _again, (type(self), str(self)), vars(self)

    def located(self, where: str, *, instead: str = "") -> Self:
        """The same error with its place in front; itself if it has one other than `instead`."""
        if self.where not in ("", instead):
            return self
        found = _again(type(self), "")
        vars(found).update(vars(self) | {"where": where})
        found.args = (str(found),)
        return found


def _again(cls: type[E], sentence: str) -> E:
    """An error whose attributes are set afterwards."""
    return cls.__new__(cls, sentence)


class InputError(CalibError):
    """What was handed in cannot be used; nothing was computed (exit code 2)."""


class TooFewPosesError(InputError):
    """A table has too few different poses for what is to be identified from it."""

    def __init__(self, message: str, *, least: int, count: int) -> None:
        super().__init__(
            message, code="M27", field="measurements", value=count, fix=f"measure at least {least}"
        )
        self.least = least
        """Different poses of this kind that may do."""


class MachineError(CalibError):
    """The machine failed: disk, memory, a lock; the run can be resumed (exit code 3)."""


def refuse(
    field: str,
    value: object = None,
    allowed: str = "",
    *,
    code: str,
    message: str = "",
    fix: str = "",
    where: str = "",
) -> InputError:
    """The error for a value that cannot be used; its message is ``FIELD is VALUE`` by default."""
    return InputError(
        message or f"{field} is {value}",
        code=code, where=where, field=field, value=value, allowed=allowed, fix=fix,
    )  # fmt: skip
