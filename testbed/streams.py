"""Named random streams: one seed per campaign, one independent generator per purpose."""

from hashlib import sha256

import numpy as np

from calib.errors import refuse


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Random numbers for one named purpose; adding a draw elsewhere never moves them.

    Parameters
    ----------
    seed : int
        Seed of the campaign, not negative.
    *names : str or int
        The purpose, e.g. ``"tracker", trial_name, 3``. The text "3" and the number 3 differ; a
        number of numpy's is that number.

    Examples
    --------
    >>> first, again = (stream(7, "tracker", "optimal-29").normal() for _ in range(2))
    >>> first == again
    True
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        message, allowed = f"seed is {seed!r}", "a whole number, 0 or larger"
        raise refuse("seed", seed, allowed, code="C41", message=message)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=_key(names)))


def _key(names: tuple[str | int, ...]) -> tuple[int, ...]:
    """Four 32-bit words per name: 128 bits of sha256, so that no two purposes ever meet."""
    words: list[int] = []
    for name in names:
        kind = "str" if isinstance(name, str) else "int"
        if kind == "int" and (isinstance(name, bool) or not isinstance(name, int | np.integer)):
            message, allowed = f"the name {name!r} of a stream", "text or a whole number"
            raise refuse("names", name, allowed, code="A3", message=message)
        digest = sha256(f"{kind}:{name}".encode()).digest()
        words += [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]
    return tuple(words)
