"""A process of the viewer: begun with settings of its own, waited for, and ended with its block."""

import json
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from calib.errors import MachineError

LOCAL = "127.0.0.1"
START_LIMIT = 40.0
"""Longest wait for a process to be ready [s]."""


@contextmanager
def private_environment() -> Iterator[dict[str, str]]:
    """Environment of a viewer process: usage statistics off, settings in a passing folder."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        kinds = ("config", "data", "cache")
        places = {f"XDG_{kind.upper()}_HOME": str(folder / kind) for kind in kinds}
        settings = folder / "config" / "rerun" / "analytics.json"
        settings.parent.mkdir(parents=True)
        refusal = {
            "analytics_enabled": False,
            "analytics_id": "0" * 32,
            "metadata": {},
            "config_file_path": str(settings),
            "data_dir_path": str(folder / "data" / "rerun" / "analytics"),
        }
        settings.write_text(json.dumps(refusal), encoding="utf-8")
        environment = {**os.environ, **places, "RUST_LOG": "error"}
        environment.setdefault("XDG_RUNTIME_DIR", name)
        yield environment


@contextmanager
def running(command: Sequence[str]) -> Iterator[subprocess.Popen[bytes]]:
    """A running process, ended with the block."""
    with private_environment() as environment:
        none = subprocess.DEVNULL
        process = subprocess.Popen(list(command), stdout=none, stderr=none, env=environment)
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def until(ready: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    """Wait until `ready`; the process must live so long.

    Raises
    ------
    MachineError
        It ended, or was not ready within `START_LIMIT`.
    """
    end = time.monotonic() + START_LIMIT
    while time.monotonic() < end and process.poll() is None:
        try:
            if ready():
                return
        except (OSError, RuntimeError):  # not listening yet, or nothing painted yet
            pass
        time.sleep(0.1)
    raise MachineError(
        "the viewer did not come up",
        code="M1",
        field="viewer",
        allowed="it needs a Vulkan driver; a software driver is enough",
        fix="on Debian or Ubuntu: apt install mesa-vulkan-drivers libvulkan1",
    )


def free_port() -> int:
    """A port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((LOCAL, 0))
        return int(probe.getsockname()[1])


def connects(port: int) -> bool:
    """Whether somebody listens on a port of this machine."""
    socket.create_connection((LOCAL, port), 0.5).close()
    return True
