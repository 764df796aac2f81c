"""Which program of a robot a text is, and the joints that it has."""

from typing import Literal, get_args

from testbed.files.dialects.controllers.fanuc import read_fanuc
from testbed.files.dialects.controllers.krl import read_krl
from testbed.files.dialects.controllers.rapid import is_rapid, read_rapid
from testbed.files.dialects.controllers.targets import JointList
from testbed.files.dialects.controllers.urscript import read_urscript
from testbed.gates.kinds import program_of
from testbed.gates.text import FileText

Language = Literal["rapid", "krl", "fanuc", "urscript"]
"""Programs that are read as joints."""
READERS = {"rapid": read_rapid, "krl": read_krl, "fanuc": read_fanuc, "urscript": read_urscript}


def language_of(text: FileText) -> Language | None:
    """The language of a program that is read as joints; None if a text is none."""
    called = program_of(text.lines)
    own = next((one for one in get_args(Language) if one == called), None)
    return own or ("rapid" if is_rapid(text) else None)


def joints_in(text: FileText, language: Language) -> JointList:
    """Joints of a program.

    Raises
    ------
    InputError
        M35: it has none, or says them while it runs.
    """
    return READERS[language](text)
