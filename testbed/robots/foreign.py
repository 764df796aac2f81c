"""The door for libraries of others: what they raise about a user's file leaves as our one error."""

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from calib.errors import CalibError, InputError, refuse

SILENT = logging.NullHandler()
"""Keeps what a library logs from the terminal where nobody has asked for it."""
LONGEST = 200
"""Characters of what a library says that are passed on."""


@contextmanager
def foreign(
    library: str,
    *,
    where: str,
    code: str = "R16",
    told: Callable[[Exception], InputError] | None = None,
) -> Iterator[None]:
    """Around one call of a library that reads what a user wrote; no code of ours stands inside.

    Such a library raises what it likes, and tells on the terminal what it finds odd: neither
    leaves. Only memory that runs out is no fault of the file. `told` may put the error into words.

    Raises
    ------
    InputError
        The library raised: what it said, with the file.
    """
    logging.getLogger(library.lower()).addHandler(SILENT)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            yield
        except (MemoryError, CalibError):
            raise
        except Exception as error:
            if told is not None:
                raise told(error) from error
            # others, such as TypeError, speak of the library's own code
            said = " ".join(str(error).split()) if isinstance(error, ValueError) else ""
            message = f"{library} cannot read it ({said[:LONGEST] or type(error).__name__})"
            raise refuse("file", code=code, message=message, where=where) from error
