"""Criteria by name, as they are asked for in a scenario or by a command."""

from collections.abc import Callable
from difflib import get_close_matches

from calib.arrays import require_count, require_kind
from calib.errors import refuse
from calib.information.criteria.base import Criterion
from calib.information.criteria.d import D
from calib.information.criteria.g import g_of
from calib.information.criteria.linear import A, v_of
from calib.information.criteria.spectral import O2, O4, O5, E
from calib.information.criteria.total import total_g, total_v
from calib.information.goals import NAME_GOALS, Goals

_FREE_OF_GOALS: dict[str, Callable[[str], Criterion]] = {
    "D": D,
    "O1": D,
    "A": A,
    "E": E,
    "O3": E,
    "O2": O2,
    "O4": O4,
    "O5": O5,
}
_OF_GOALS: dict[str, Callable[[Goals, str], Criterion]] = {"V": v_of, "G": g_of}
_OF_ALL: dict[str, Callable[[Goals, int, str], Criterion]] = {"V": total_v, "G": total_g}
NAMES = ("D", "A", "V", "G", "E", "O1", "O2", "O3", "O4", "O5")
"""O1 is D, and O3 is E, under the name of the observability index."""


def criterion_named(
    criterion: "str | Criterion", *, goals: Goals | None = None, inputs: int = 0
) -> Criterion:
    """The criterion with a given name; a `Criterion` is returned as it is.

    Parameters
    ----------
    criterion : str or Criterion
        ``"D"``, ``"A"``, ``"V"``, ``"G"``, ``"E"``, or ``"O1"`` to ``"O5"``.
    goals : Goals, optional
        Goal poses and their weights, for V and G.
    inputs : int
        Number of error sources common to all readings; V and G then count them, from blocks with
        as many further columns (see `calib.information.criteria.total`).

    Raises
    ------
    InputError
        A4: there is no such name; M29: V or G has no goals.
    """
    if isinstance(criterion, Criterion):
        return criterion
    require_kind("criterion", criterion, str, f"one of {', '.join(NAMES)}")
    if goals is not None:
        require_kind("goals", goals, Goals, "what calib.information.goals.goal_matrix gave")
    inputs = require_count("inputs", inputs, 0)
    if criterion in _FREE_OF_GOALS:
        return _FREE_OF_GOALS[criterion](criterion)
    if criterion in _OF_GOALS:
        if goals is None:
            message = f'criterion "{criterion}" needs goal poses'
            raise refuse("goals", code="M29", message=message, fix=NAME_GOALS)
        if inputs:
            return _OF_ALL[criterion](goals, inputs, criterion)
        return _OF_GOALS[criterion](goals, criterion)
    close = get_close_matches(str(criterion).upper(), NAMES, 1)
    raise refuse(
        "criterion",
        criterion,
        f"one of {', '.join(NAMES)}",
        code="A4",
        message=f'criterion is "{criterion}"',
        fix=f'did you mean "{close[0]}"?' if close else "",
    )
