"""What the keys and tables of a schema mean: the sentences below fields, the units in names."""

import ast
import inspect
import re
import sys
from functools import cache

from testbed.gates.mistakes import UNITS
from testbed.strict import Strict

FURTHER_UNITS = {
    "um_per_sqrt_h": "um/√h", "um_per_m_k": "um/(m K)", "um_per_m": "um/m", "per_k": "1/K",
    "nm_per_mrad": "N m/mrad", "kg_m2": "kg m²", "kg_m": "kg m", "m_s2": "m/s²",
    "deg_s": "deg/s", "mm_s": "mm/s", "mm_deg": "mm, deg", "nm": "N m", "n": "N", "degC": "°C",
    "mdeg_k": "mdeg",
}  # fmt: skip
"""Ends of keys and their units where people read them otherwise than a message, or alone."""
BARE = ("s", "h", "k", "n")
"""Ends that are units only after an underscore."""


@cache
def _module(name: str) -> ast.Module:
    """A module as it is written."""
    return ast.parse(inspect.getsource(sys.modules[name]))


def meaning(model: type[Strict], name: str) -> str:
    """The sentence below a field: of the class that declares it, or the nearest one above."""
    for kind in model.__mro__:
        if name not in inspect.get_annotations(kind):
            continue
        for node in ast.walk(_module(kind.__module__)):
            if isinstance(node, ast.ClassDef) and node.name == kind.__name__:
                return _below(node, name)
    return ""


def _below(node: ast.ClassDef, name: str) -> str:
    """The text below one field of a class; empty where there is none."""
    after = [*node.body[1:], ast.Pass()]
    for line, below in zip(node.body, after, strict=True):
        is_field = isinstance(line, ast.AnnAssign) and ast.unparse(line.target) == name
        if is_field and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            return " ".join(str(below.value.value).split())
    return ""


def unit(name: str) -> str:
    """The unit that the end of a key states."""
    for end, written in sorted((UNITS | FURTHER_UNITS).items(), key=lambda pair: -len(pair[0])):
        if name.endswith(f"_{end}") or (name == end and end not in BARE):
            return written.replace("um", "µm")
    return ""


def summary(model: type[Strict]) -> tuple[str, str]:
    """What a table is, in one line without its name, and what its docstring says further."""
    first, _, rest = (inspect.getdoc(model) or "").partition("\n\n")
    title = re.sub(r"^\[[^:]*: ", "", first)
    return title[:1].upper() + title[1:], rest
