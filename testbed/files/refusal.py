"""How a measurement file is refused: where, which column or key, and a sentence."""

from collections.abc import Sequence

from calib.errors import InputError, refuse


def refusal(
    where: str,
    field: str,
    message: str,
    *,
    code: str = "M35",
    value: object = None,
    allowed: str = "",
    fix: str = "",
) -> InputError:
    """The error of a file, or of one of its lines; M35 is the code of a table that is not one.

    Parameters
    ----------
    where : str
        File, or file and line.
    field : str
        Column, or key of session.toml.
    message, value, allowed, fix
        As in `calib.errors.CalibError`.
    """
    return refuse(field, value, allowed, code=code, message=message, fix=fix, where=where)


def require_names(column: str, names: Sequence[str], place: Sequence[str]) -> None:
    """Refuse a row (m,) without a name in a column of names.

    Raises
    ------
    InputError
        M25: the first such row.
    """
    if "" in names:
        fix = "fill the cell" if any(names) else "name each row, or take the column out"
        where = place[list(names).index("")]
        raise refusal(where, column, f"{column} is empty", code="M25", fix=fix)


def no_rows(where: str) -> InputError:
    """The error of a table that has names of columns and nothing below them."""
    return refusal(
        where, "measurements", "names its columns and has no rows below them", code="M27",
        fix="give the file with what was measured",
    )  # fmt: skip
