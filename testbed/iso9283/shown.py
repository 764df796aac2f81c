"""What the recording of a test shows, as a record from which it is written again."""

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Annotated

import numpy as np

from calib.arrays import LATER, Array, frozen
from testbed.iso9283.figure_words import show, unit
from testbed.iso9283.records import CycleResult, StatedFigure
from testbed.iso9283.words import drift_words, mark, notice, verdict
from testbed.store.npz import canonical
from testbed.units import plain

RECORD = "test"
MOST_POSES = 40
"""Poses that are shown, the first ones."""


@dataclass(frozen=True, slots=True, eq=False)
class ShownPath:
    """One path, as commanded and on average."""

    name: str
    command: Annotated[Array, "m", 3]
    """(m, 3) [m]"""
    mean: Annotated[Array, "m", 3]
    """(m, 3) [m]"""
    AT: Annotated[Array, "m"]
    """(m,) [m]"""
    RT: Annotated[Array, "m"]
    """(m,) [m]"""
    said: str
    """Its figures in words."""


@dataclass(frozen=True, slots=True, eq=False)
class ShownTest:
    """Where a robot was sent, where it came to, and what follows."""

    name: str
    notice: str
    mark: str
    verdict: str
    poses: tuple[str, ...]
    """(e,) names."""
    command: Annotated[Array, "e", 3]
    """(e, 3) [m]"""
    position: Annotated[Array, "e", "n", 3]
    """(e, n, 3) readings in the frame of the commands, cycles in the order of their times [m]."""
    AP: Annotated[Array, "e"]
    """(e,) [m]"""
    RP: Annotated[Array, "e"]
    """(e,) [m]"""
    said: tuple[str, ...]
    """(e,) AP and RP in words, with their limits."""
    drift: str
    """What cycle after cycle shows, in words."""
    paths: tuple[ShownPath, ...]
    sent_to: Annotated[tuple[str, ...], LATER] = ()
    """(e,) the poses that these are, without the direction that each is reached from."""

    @property
    def called(self) -> tuple[str, ...]:
        """(e,) what poses are called in a sentence."""
        return tuple(
            name if name.casefold().startswith("pose") else f"pose {name}" for name in self.poses
        )

    @property
    def labels(self) -> dict[int, str]:
        """The pose at each commanded place, by the first of the entries that are there."""
        entries = dict[tuple[float, ...], list[int]]()
        for k, place in enumerate(self.command.tolist()):
            entries.setdefault(tuple(place), []).append(k)
        labels = dict[int, str]()
        for own in entries.values():
            # of one pose that is reached from several directions its name alone
            pose = {self.sent_to[k] for k in own} if self.sent_to else set[str]()
            alone = len(own) > 1 and len(pose) == 1
            labels[own[0]] = ", ".join(pose if alone else [self.poses[k] for k in own])
        return labels


def shown_test(result: CycleResult) -> ShownTest:
    """The poses and paths of a test, and its words."""
    test, visits = result.test, result.test.visits
    poses: tuple[str, ...] = ()
    sent_to: tuple[str, ...] = ()
    command, position = np.zeros((0, 3)), np.zeros((0, 2, 3))
    if visits is not None:
        poses, command, position = visits.names[:MOST_POSES], visits.command, visits.position
        sent_to = visits.pose[:MOST_POSES]
        if visits.time is not None:
            order = np.argsort(visits.time.mean(axis=0), kind="stable")
            position = position[:, order]
    AP, RP = result.of("AP")[: len(poses)], result.of("RP")[: len(poses)]
    return ShownTest(
        name=test.name,
        notice=notice(result),
        mark=plain(mark(result)),
        verdict=plain(verdict(result)),
        poses=poses,
        command=frozen(command[: len(poses)]),
        position=frozen(position[: len(poses)]),
        AP=frozen(np.array([figure.value for figure in AP])),
        RP=frozen(np.array([figure.value for figure in RP])),
        said=tuple(f"{told(a)}; {told(r)}" for a, r in zip(AP, RP, strict=True)),
        drift=plain(drift_words(result)),
        paths=tuple(
            ShownPath(path.name, path.command, path.mean, path.AT, path.RT, path_told(result, k))
            for k, path in enumerate(result.paths)
        ),
        sent_to=sent_to,
    )


def told(figure: StatedFigure) -> str:
    """A figure with its limits, in few words."""
    low, high = show(figure.lower, figure), show(figure.upper, figure)
    return f"{figure.name} {show(figure.value, figure)} {unit(figure)} ({low} to {high})"


def path_told(result: CycleResult, k: int) -> str:
    """AT and RT of a path, with their limits."""
    return "; ".join(told(result.of(name)[k]) for name in ("AT", "RT"))


def spec_of(files: Mapping[str, str]) -> str:
    """Hash of the names and hashes of the files that a record follows from."""
    return sha256(canonical(dict(files))).hexdigest()
