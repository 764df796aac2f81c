"""manifest.json: what a run folder says about itself."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib.errors import InputError, refuse
from testbed.gates.paths import is_there
from testbed.store.documents import check_format, damaged, read_json
from testbed.store.foreign import foreign
from testbed.store.layout import FORMAT, MANIFEST, SCENARIO
from testbed.store.npz import pretty_json
from testbed.versions import number_versions

PROCESSORS = "processors"
"""How many pieces each kind of processor has played: bits are promised for one kind only."""
CAMPAIGN, CALIBRATION = "campaign", "calibration"
"""Kinds of run folders: a scenario played, or measurements identified from."""
GROWING = "growing_sha256"
"""Hash of a scenario without its numbers of robots: with more of them what was played is kept."""

HASHES = {CAMPAIGN: "scenario_sha256", CALIBRATION: "input_sha256"}
"""What each kind's manifest names its input by."""


def kind_of(document: Mapping[str, Any]) -> str:
    """Kind of the run folder that a manifest belongs to."""
    return str(document.get("kind", CAMPAIGN))


def require_campaign(path: Path, document: Mapping[str, Any]) -> None:
    """Refuse a run folder that no scenario was played into."""
    if kind_of(document) != CAMPAIGN:
        told = f"holds a {kind_of(document)}, not a campaign"
        raise _unusable(path, told, fix="give a folder that truebed run wrote")


def manifest_bytes(about: Mapping[str, Any]) -> bytes:
    """The manifest's file: format, `about`, and the versions that decide the numbers."""
    return pretty_json({"format": FORMAT, **about, "versions": number_versions()})


def read_manifest(path: Path) -> dict[str, Any]:
    """The manifest of a run folder, checked.

    Raises
    ------
    InputError
        It is no run folder, or one of a newer version, or damaged.
    """
    fix = "give the command that wrote it again, with another --out"
    if is_there(path / SCENARIO):  # the folder of a calibration has none
        fix = f"run {path / SCENARIO} again with another --out"
    try:
        document = read_json(path / MANIFEST, fix=fix)
    except (FileNotFoundError, NotADirectoryError) as error:
        told, fix = foreign(path)
        raise _unusable(path, f"is not a run folder: {told}", fix=fix) from error
    check_format(document, path / MANIFEST, fix)
    if kind_of(document) not in HASHES:
        raise damaged(path / MANIFEST, f"kind is {kind_of(document)!r}", fix)
    for name, kind in ((HASHES[kind_of(document)], str), ("versions", dict)):
        if not isinstance(document.get(name), kind):
            raise damaged(path / MANIFEST, f"{name} is missing", fix)
    return document


def check_same_run(path: Path, scenario_hash: str, growing_hash: str = "") -> bool:
    """Whether a run is of just this scenario, or of one with more or fewer robots.

    Raises
    ------
    InputError
        It is of another scenario, or was begun with other versions.
    """
    document = read_manifest(path)
    require_campaign(path, document)
    same = bool(document["scenario_sha256"] == scenario_hash)
    if not same and (not growing_hash or document.get(GROWING) != growing_hash):
        fix = f"run {path / SCENARIO} to go on with that one, or choose another --out"
        told = "holds a run of another scenario, seed or robot"
        raise _unusable(path, told, field="--resume", fix=fix)
    changes = _changes(document["versions"], number_versions(), "here")
    if changes:
        told = f"was begun with other versions: {changes}"
        fix = "install those, or start again in another --out"
        raise _unusable(path, told, field="--resume", fix=fix)
    return same


def check_same_runs(path: Path, other: Path) -> None:
    """Refuse two folders that were not begun with one scenario and the same versions."""
    one, second = read_manifest(path), read_manifest(other)
    require_campaign(other, second)
    fix = "merge folders of one run only"
    if one["scenario_sha256"] != second["scenario_sha256"]:
        told = f"holds a run of another scenario, seed or robot than {path}"
        raise _unusable(other, told, field="merge", fix=fix)
    if changes := _changes(second["versions"], one["versions"], f"in {path}"):
        raise _unusable(other, f"was begun with other versions: {changes}", field="merge", fix=fix)


def _changes(theirs: Mapping[str, str], ours: Mapping[str, str], here: str) -> str:
    """Versions that differ, in words."""
    return "; ".join(
        f"{name} {theirs.get(name, 'unknown')} there, {ours[name]} {here}"
        for name in ours
        if theirs.get(name) != ours[name]
    )


def _unusable(
    path: Path, message: str, allowed: str = "", *, field: str = "", fix: str = ""
) -> InputError:
    """The error for a folder whose manifest does not fit."""
    return refuse(field, None, allowed, code="D42", message=message, fix=fix, where=str(path))
