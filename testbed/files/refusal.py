"""How a measurement file is refused: where, which column or key, and a sentence."""

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
