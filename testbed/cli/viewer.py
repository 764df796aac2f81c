"""The Rerun viewer: open a recording, take its picture without a screen, ask what a view reports.

Every process is the viewer's own binary, bound to 127.0.0.1, with usage statistics off and its
settings in a folder that is thrown away.
"""

import gzip
import os
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from calib.errors import InputError, MachineError
from testbed.cli.page import page
from testbed.cli.processes import LOCAL, connects, free_port, private_environment, running, until

NOTES_FADE = 6.5
"""A starting viewer shows notes over the window for so long [s]."""
PAINTED = 2.0
"""By then all meshes are on the screen [s]."""
PAINTINGS = 6
"""A viewer is asked so often to paint its window, each time for some seconds."""


@dataclass(frozen=True, slots=True)
class Report:
    """What one view of the viewer has to say about its contents."""

    view: str
    severity: str
    """"error" or "warning"."""
    text: str


def verify(rrd: str | Path) -> bool:
    """Whether a recording is whole and readable; a file cut short is not."""
    return _rrd("verify", existing(rrd)) == 0


def compare(one: str | Path, other: str | Path) -> bool:
    """Whether two recordings hold the same rows in any order; floats may differ by about 1e-8."""
    return _rrd("compare", "--unordered", existing(one), existing(other)) == 0


def picture(
    rrd: str | Path,
    png: str | Path,
    *,
    step: int | None = None,
    size: tuple[int, int] = (1600, 1000),
    view: str | None = None,
) -> tuple[Report, ...]:
    """Write a picture of a recording without a screen; returns what the views complain of.

    Parameters
    ----------
    rrd : path
        Recording.
    png : path
        Picture to write.
    step : int, optional
        Place on the story's timeline; the viewer's own start if None.
    size : (int, int)
        Width and height of the window.
    view : str, optional
        Name of one view instead of the whole window.

    Raises
    ------
    InputError
        No such recording, or no such view.
    MachineError
        No viewer came up: there is no Vulkan driver, software or other.
    """
    with _headless(existing(rrd), size) as client:
        if step is not None:
            client.set_time("step", sequence=step, play_state="paused")
        _painted(client)  # and the meshes begin to load
        chosen = None if view is None else _view_id(client.get_state(), view)
        # a picture of one view does not show the notes over the window
        time.sleep(NOTES_FADE if chosen is None else PAINTED)
        state = client.get_state()
        Path(png).write_bytes(client.take_screenshot(chosen))
        return _reports(state)


def view_reports(rrd: str | Path, steps: Sequence[int] = (0,)) -> tuple[Report, ...]:
    """Errors and warnings of any view at any of these steps; empty for a sound recording."""
    found: dict[Report, None] = {}
    with _headless(existing(rrd), (1200, 800)) as client:
        for step in steps:
            client.set_time("step", sequence=step, play_state="paused")
            _painted(client)  # reports come with painting
            found |= dict.fromkeys(_reports(client.get_state()))
    return tuple(found)


def _painted(client: Any) -> None:
    """Wait until the window has been painted; on a busy machine that outlasts a call's deadline."""
    for patience in range(PAINTINGS, 0, -1):
        try:
            client.take_screenshot(max_size=64)
        except TimeoutError as error:
            if patience == 1:
                raise MachineError(
                    "the viewer does not paint its window",
                    code="M1",
                    fix="try again when the machine is less busy",
                ) from error
        else:
            return


def open_viewer(rrd: str | Path, tell: Callable[[str], None] = lambda _: None) -> None:
    """Show a recording and return when the viewer is closed.

    With a display this is the native viewer. Without one it is the viewer for browsers, served on
    this machine only; `tell` receives the sentence that says where.
    """
    file = existing(rrd)
    if has_display():
        tell("The viewer is open; close its window to go on.")
        with running([str(native()), "--port", "auto", "--bind", LOCAL, str(file)]) as viewer:
            if viewer.wait() != 0:
                raise MachineError(
                    "the viewer ended with an error",
                    code="M1",
                    where=str(file),
                    fix="update the graphics driver, or open the file on another machine",
                )
        return
    with serve(file) as address:
        tell(f"There is no display here. Open {address} in a browser; Ctrl+C ends it.")
        while True:
            time.sleep(3600)


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


@contextmanager
def serve(rrd: Path | None = None) -> Iterator[str]:
    """Address of the viewer for browsers, with a recording in it or none, while the block runs."""
    data, web = free_port(), free_port()
    words = ["--serve-web", "--bind", LOCAL, "--port", str(data), "--web-viewer-port", str(web)]
    with running([str(native()), *words, *([str(rrd)] if rrd else [])]) as server:
        until(lambda: connects(web), server)
        query = f"?url=rerun%2Bhttp://{LOCAL}:{data}/proxy" if rrd else ""
        yield f"http://{LOCAL}:{web}/{query}"


def html_page(rrd: str | Path, out: str | Path) -> None:
    """Write a recording and its viewer as one HTML file that opens without a network.

    Raises
    ------
    InputError
        No such recording.
    MachineError
        The viewer's own server, from which the page is made, did not come up.
    """
    import rerun as rr

    file = existing(rrd)
    script, binary = viewer_files()
    text = page(file.stem, file.read_bytes(), script, binary, rr.__version__)
    Path(out).write_text(text, encoding="utf-8")


def viewer_files() -> tuple[str, bytes]:
    """JavaScript and WebAssembly of the viewer for browsers, out of the installed package."""
    with serve() as address:
        script, binary = (_fetch(address + name) for name in ("re_viewer.js", "re_viewer_bg.wasm"))
    packed = binary[:2] == b"\x1f\x8b"
    return script.decode(), gzip.decompress(binary) if packed else binary


def existing(rrd: str | Path) -> Path:
    """Absolute path of a recording that is there."""
    path = Path(rrd).resolve()
    if not path.is_file():
        raise InputError(
            "no such recording", code="F3", where=str(rrd), field="rrd", fix="truebed record RUN"
        )
    return path


def native() -> Path:
    """The viewer's own binary; the command beside Python's is a wrapper that leaves orphans."""
    import rerun_cli

    folder = Path(str(rerun_cli.__file__)).parent
    return folder / ("rerun.exe" if sys.platform == "win32" else "rerun")


@contextmanager
def _headless(rrd: Path, size: tuple[int, int]) -> Iterator[Any]:
    """Client of a viewer without a window that has loaded a recording."""
    from rerun.experimental import ViewerClient

    port = free_port()
    words = ["--headless", "--hide-welcome-screen", "--bind", LOCAL, "--port", str(port)]
    words += ["--window-size", f"{size[0]}x{size[1]}", str(rrd)]
    with running([str(native()), *words]) as viewer:
        until(lambda: connects(port), viewer)
        client = ViewerClient.connect(f"rerun+http://{LOCAL}:{port}/proxy")

        def loaded() -> bool:
            state = client.get_state()
            return bool(state.recordings and not state.loading and state.views)

        until(loaded, viewer)
        yield client


def _fetch(address: str) -> bytes:
    """What a server of this machine answers."""
    with urllib.request.urlopen(address, timeout=30) as answer:
        return bytes(answer.read())


def _reports(state: Any) -> tuple[Report, ...]:
    """Everything the views report."""
    return tuple(
        Report(str(view.name), str(report.severity), str(report.summary))
        for view in state.views
        for report in view.reports
    )


def _view_id(state: Any, name: str) -> Any:
    """Identifier of a view by its name."""
    for view in state.views:
        if view.name == name:
            return view.view_id
    raise InputError(
        f'the recording has no view "{name}"',
        code="F3",
        field="view",
        value=name,
        allowed=", ".join(str(view.name) for view in state.views),
    )


def _rrd(verb: str, *words: str | Path) -> int:
    """Exit status of a check of recordings."""
    with private_environment() as environment:
        return subprocess.run(
            [str(native()), "rrd", verb, *map(str, words)],
            capture_output=True,
            check=False,
            env=environment,
        ).returncode
