"""Numbers that no measurement tells from others, in few words."""

from calib.information.reduction import Reduction
from testbed.units import sentence


def left_nominal(found: Reduction) -> tuple[str, ...]:
    """What stands for each dropped number in one sentence; what else is said of them as it is.

    Examples
    --------
    >>> from calib.geometry.chain import Chain
    >>> from calib.geometry.model import RobotModel
    >>> from calib.geometry.parameters import parameters_of
    >>> from calib.information.reduction import reduce
    >>> import numpy as np
    >>> model = RobotModel(Chain(np.zeros((1, 5))))
    >>> table = parameters_of(model).freeing(("d1", "a1"))
    >>> left_nominal(reduce([[1.0, 1.0]] * 2, table, model=model))
    ('Left nominal: a1 (as d1).',)
    """
    pairs = [f"{one.name} (as {one.others})" for one in found.dependencies if one.others]
    told = found.sentences_without([one.name for one in found.dependencies if one.others])
    others = (sentence(text, keep_name=True) for text in told)
    return (*([f"Left nominal: {', '.join(pairs)}."] if pairs else []), *others)
