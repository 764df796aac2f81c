"""Optimal design of pose sets: the problem, methods that solve it, and proven bounds.

Where a function and its module share a name, `calib.design.exchange` is the function.
"""

from collections.abc import Callable

import numpy as np

from calib.design.augment import Ranking as Ranking
from calib.design.augment import best_next as best_next
from calib.design.certificate import Certificate as Certificate
from calib.design.certificate import certify as certify
from calib.design.detmax import detmax as detmax
from calib.design.exchange import exchange as exchange
from calib.design.exchange import fedorov as fedorov
from calib.design.greedy import greedy as greedy
from calib.design.pose_budget import PoseBudget as PoseBudget
from calib.design.pose_budget import pose_budget as pose_budget
from calib.design.pose_count import PoseCount as PoseCount
from calib.design.pose_count import pose_count as pose_count
from calib.design.problem import Problem as Problem
from calib.design.random import UNTOLD as UNTOLD
from calib.design.random import RandomFigures as RandomFigures
from calib.design.random import best_of_random as best_of_random
from calib.design.random import random_selection as random_selection
from calib.design.random import random_set as random_set
from calib.design.random import random_sets as random_sets
from calib.design.relaxation import Weights as Weights
from calib.design.relaxation import relaxation as relaxation
from calib.design.selection import Selection as Selection

METHODS: dict[str, Callable[[Problem, np.random.Generator], Selection]] = {
    "random": random_set,
    "best_of_random": best_of_random,
    "greedy": lambda problem, _: greedy(problem),
    "detmax": detmax,
    "fedorov": fedorov,
    "exchange": exchange,
}
"""Every method of selecting poses, by its name in a scenario; all but greedy draw random starts."""
