"""Which program of a robot a text is, and the joints that it has."""

from collections.abc import Callable
from typing import Literal, get_args

from testbed.files.dialects.controllers.doosan import is_doosan, read_doosan
from testbed.files.dialects.controllers.fanuc import read_fanuc
from testbed.files.dialects.controllers.inform import read_inform
from testbed.files.dialects.controllers.kawasaki import is_kawasaki, read_kawasaki
from testbed.files.dialects.controllers.krl import read_krl
from testbed.files.dialects.controllers.rapid import is_rapid, read_rapid
from testbed.files.dialects.controllers.rokae import is_rokae, read_rokae
from testbed.files.dialects.controllers.targets import JointList
from testbed.files.dialects.controllers.urscript import read_urscript
from testbed.files.dialects.controllers.val3 import read_val3
from testbed.gates.kinds import program_of
from testbed.gates.text import FileText

Language = Literal[
    "rapid", "krl", "fanuc", "urscript", "doosan", "kawasaki", "inform", "val3", "rokae"
]  # fmt: skip
"""Programs that are read as joints."""
READERS = {
    "rapid": read_rapid, "krl": read_krl, "fanuc": read_fanuc, "urscript": read_urscript,
    "doosan": read_doosan, "kawasaki": read_kawasaki, "inform": read_inform, "val3": read_val3,
    "rokae": read_rokae,
}  # fmt: skip
BY_ANY_LINE: dict[Language, Callable[[FileText], bool]] = {
    "doosan": is_doosan, "kawasaki": is_kawasaki, "rokae": is_rokae
}  # fmt: skip
"""Languages whose first lines may be those of another one, or may say nothing."""


def language_of(text: FileText) -> Language | None:
    """The language of a program that is read as joints; None if a text is none."""
    for language, is_one in BY_ANY_LINE.items():
        if is_one(text):
            return language
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
