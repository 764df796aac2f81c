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
        The purpose, e.g. ``"tracker", trial_name, 3``. The text "3" and the number 3 differ.

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
        digest = sha256(f"{type(name).__name__}:{name}".encode()).digest()
        words += [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]
    return tuple(words)
