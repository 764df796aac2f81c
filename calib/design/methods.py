"""Every method of selecting poses, by its name in a scenario."""

from collections.abc import Callable

from calib.design.detmax import detmax
from calib.design.exchange import exchange, fedorov
from calib.design.greedy import greedy
from calib.design.random import best_of_random, random_set
from calib.design.selection import Selection

METHODS: dict[str, Callable[..., Selection]] = {
    "random": random_set,
    "best_of_random": best_of_random,
    "greedy": greedy,
    "detmax": detmax,
    "fedorov": fedorov,
    "exchange": exchange,
}
