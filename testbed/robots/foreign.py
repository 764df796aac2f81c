"""Calls of other libraries on a user's file, whose exceptions become our one error."""

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from calib.errors import CalibError, InputError, refuse

SILENT = logging.NullHandler()
"""Handler that keeps log messages of libraries off the terminal."""
LONGEST = 200
"""Number of characters of a library's message that are passed on."""


@contextmanager
def foreign(
    library: str,
    *,
    where: str,
    code: str = "R16",
    told: Callable[[Exception], InputError] | None = None,
) -> Iterator[None]:
    """Context manager for one call of a library that reads a user's file, with no code of ours.

    Whatever the library raises becomes an InputError, except running out of memory and a package
    that does not load, and its warnings are kept off the terminal. `told` may make the error from
    the exception.

    Raises
    ------
    InputError
        The library raised an exception; the error has its message and the file.
    """
    logging.getLogger(library.lower()).addHandler(SILENT)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            yield
        except (MemoryError, CalibError, ImportError):
            raise  # a package that does not load is no fault of the file
        except Exception as error:
            if told is not None:
                raise told(error) from error
            # others, such as TypeError, speak of the library's own code
            said = " ".join(str(error).split()) if isinstance(error, ValueError) else ""
            message = f"{library} cannot read it ({said[:LONGEST] or type(error).__name__})"
            raise refuse("file", code=code, message=message, where=where) from error
