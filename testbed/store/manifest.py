"""manifest.json: what a run folder says about itself."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib.errors import InputError
from testbed.store.layout import FORMAT, MANIFEST, SCENARIO
from testbed.store.npz import pretty_json, strict_json
from testbed.versions import number_versions

CAMPAIGN, CALIBRATION = "campaign", "calibration"
"""Kinds of run folders: a scenario played, or measurements identified from."""


HASHES = {CAMPAIGN: "scenario_sha256", CALIBRATION: "input_sha256"}
"""What each kind's manifest names its input by."""


def kind_of(document: Mapping[str, Any]) -> str:
    """Kind of the run folder that a manifest belongs to."""
    return str(document.get("kind", CAMPAIGN))


def require_campaign(path: Path, document: Mapping[str, Any]) -> None:
    """Refuse a run folder that no scenario was played into."""
    if kind_of(document) != CAMPAIGN:
        raise InputError(
            f"holds a {kind_of(document)}, not a campaign",
            code="D42",
            where=str(path),
            allowed="the folder that `truebed run` wrote",
        )


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
    try:
        document = strict_json((path / MANIFEST).read_bytes())
    except OSError as error:
        raise InputError(
            "is not a run folder",
            code="D42",
            where=str(path),
            allowed=f"a run folder holds {MANIFEST}",
            fix="give the folder that `truebed run` wrote",
        ) from error
    except ValueError as error:
        raise _damaged(path, str(error)) from error
    version = document.get("format")
    if isinstance(version, int) and version > FORMAT:
        raise InputError(
            f"has format {version}",
            code="D42",
            where=str(path / MANIFEST),
            field="format",
            value=version,
            allowed=f"this version reads format {FORMAT}",
            fix="install a newer truebed",
        )
    if version != FORMAT or isinstance(version, bool):
        raise _damaged(path, f"format is {version!r}")
    if kind_of(document) not in HASHES:
        raise _damaged(path, f"kind is {kind_of(document)!r}")
    for name, kind in ((HASHES[kind_of(document)], str), ("versions", dict)):
        if not isinstance(document.get(name), kind):
            raise _damaged(path, f"{name} is missing")
    return document


def check_same_run(path: Path, scenario_hash: str) -> None:
    """Refuse to go on with a run of another scenario or begun with other versions."""
    document = read_manifest(path)
    require_campaign(path, document)
    if document["scenario_sha256"] != scenario_hash:
        raise InputError(
            "holds a run of another scenario, seed or robot",
            code="D42",
            where=str(path),
            field="--resume",
            fix=f"run {path / SCENARIO} to go on with that one, or choose another --out",
        )
    ours, theirs = number_versions(), document["versions"]
    changes = [
        f"{name} {theirs.get(name, 'unknown')} there, {ours[name]} here"
        for name in ours
        if theirs.get(name) != ours[name]
    ]
    if changes:
        raise InputError(
            f"was begun with other versions: {'; '.join(changes)}",
            code="D42",
            where=str(path),
            field="--resume",
            fix="install those, or start again in another --out",
        )


def _damaged(path: Path, reason: str) -> InputError:
    """The manifest cannot be used."""
    return InputError(
        f"is damaged: {reason}",
        code="D42",
        where=str(path / MANIFEST),
        fix=f"run {path / SCENARIO} again with another --out",
    )
