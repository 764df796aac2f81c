"""What fields of records state of their sizes is what their docstrings say."""

import ast
import dataclasses
import inspect
import re
import typing
from itertools import pairwise
from pathlib import Path

import numpy as np

from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.joint_errors import JointErrors
from calib.identification.prior import Prior
from testbed.identify.folder import RECORDS
from testbed.store.codec import _hints, _sizes
from testbed.studies import all_studies, load_scenario

SCENES = ("quick", "wen2022", "stations", "pose_sets", "coverage", "compensate",
          "wen2022_reexamined")  # fmt: skip
EMPTY = {
    "TrialSets.indices",
    "Choice.confirmation",
    "CoverageStudy.nees",
    "TargetStatement.radius_move",
}
"""May have no entries instead."""
ALONE = {"Identification.trace"}
"""Its length is that of nothing else."""
OWN = (Chain, JointErrors, Fixtures, Prior)
"""Look at their arrays themselves."""


def classes():
    """Every dataclass in the records of the shipped scenes and of a calibration."""
    waiting = [*RECORDS.values()]
    for scene in SCENES:
        scenario = load_scenario(scene)
        waiting += [one.kind for study in all_studies(scenario) for one in study.records(scenario)]
    waiting = list(dict.fromkeys(waiting))
    for cls in waiting:
        hints = list(_hints(cls).values())
        for hint in hints:
            hints += [arg for arg in typing.get_args(hint) if arg is not Ellipsis]
            if isinstance(hint, type) and dataclasses.is_dataclass(hint) and hint not in waiting:
                waiting.append(hint)
    return waiting


def is_array(hint):
    """Whether a field holds an array, or one or none."""
    bare = [getattr(one, "__origin__", one) if hasattr(one, "__metadata__") else one
            for one in (hint, *typing.get_args(hint))]  # fmt: skip
    return typing.get_origin(hint) is not tuple and any(
        typing.get_origin(one) is np.ndarray for one in bare
    )


def documented(cls):
    """The shapes that begin the docstrings of its fields."""
    tree = ast.parse(Path(inspect.getsourcefile(cls)).read_text(encoding="utf-8"))
    (body,) = (node.body for node in tree.body if getattr(node, "name", "") == cls.__name__)
    for field, text in pairwise(body):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr):
            found = re.match(r"\(([^()]*)\)", text.value.value)
            if found:
                parts = [part.strip() for part in found[1].split(",") if part.strip()]
                yield field.target.id, tuple(int(p) if p.isdigit() else p for p in parts)


def test_every_field_states_the_shape_of_its_docstring():
    count = 0
    for cls in classes():
        if cls in OWN:
            continue
        documents = dict(documented(cls))
        for name, shape in documents.items():
            if is_array(_hints(cls)[name]) and f"{cls.__name__}.{name}" not in EMPTY | ALONE:
                told = f"{cls.__name__}.{name} states no {shape}: write Annotated[Array, ...]"
                assert _sizes(cls).get(name) == shape, told
                count += 1
        for name, shape in _sizes(cls).items():
            assert documents[name] == shape, (cls.__name__, name)
    assert count > 100
