"""The Rerun viewer: open a recording, take its picture without a screen, make a page of it.

Every process is the binary of the viewer, bound to 127.0.0.1, with usage statistics off and its
settings in a folder that is thrown away.
"""

import base64
import gzip
import os
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from calib.errors import MachineError, refuse
from testbed.cli.recording_steps import step_of
from testbed.cli.viewer_process import LOCAL, connects, free_port, running, until
from testbed.disk import atomic_write
from testbed.gates.paths import is_there

PAGE = Path(__file__).with_name("viewer.html")
"""The page for browsers: it opens from a file, fetches nothing, and inlines the viewer."""
PLACED = ("new URL(document.currentScript.src, location.href)", "new URL(document.baseURI)")
"""Where the viewer's script asks for its own address, which a page within a page has not."""
SIZE = (1600, 1000)
"""Width and height of the window of a picture."""
NOTES_FADE = 6.5
"""A starting viewer shows notes over the window for so long [s]."""
PAINTINGS = 6
"""A viewer is asked so often to paint its window, each time for some seconds."""


def picture(
    rrd: str | Path,
    png: str | Path,
    *,
    step: int | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> None:
    """Write a picture of a recording without a screen.

    Parameters
    ----------
    rrd : path
        Recording.
    png : path
        Picture to write.
    step : int, optional
        Place on the story's timeline; its last one if None.
    tell : callable
        Receives the sentence that it is being drawn.

    Raises
    ------
    InputError
        No such recording, or no such step.
    MachineError
        No viewer came up: there is no Vulkan driver, software or other.
    """
    file = existing(rrd)
    at = step_of(file, step)
    tell(f"Drawing {png}; this takes up to half a minute.")
    with headless(file) as client:
        # a viewer plays as it starts: it would be wherever it has got to by then
        client.set_time("step", sequence=at, play_state="paused")
        paint(client)  # and the meshes begin to load
        time.sleep(NOTES_FADE)
        atomic_write(Path(png), client.take_screenshot(None))


def paint(client: Any) -> None:
    """Wait until the window is painted; on a busy machine that outlasts a call's deadline."""
    for patience in range(PAINTINGS, 0, -1):
        try:
            client.take_screenshot(max_size=64)
        except TimeoutError as error:
            if patience == 1:
                message = "the viewer does not paint its window"
                fix = "try again when the machine is less busy"
                raise MachineError(message, code="M1", fix=fix) from error
        else:
            return


def open_viewer(rrd: str | Path, tell: Callable[[str], None] = lambda _: None) -> None:
    """Show a recording and return when the viewer is closed.

    With a display this is the native viewer. Without one it is the viewer for browsers, served on
    this machine only; `tell` receives the sentence with its address.
    """
    file = existing(rrd)
    if has_display():
        tell("The viewer is open; close its window to go on.")
        with running([str(native()), "--port", "auto", "--bind", LOCAL, str(file)]) as viewer:
            if viewer.wait() != 0:
                message = "the viewer ended with an error"
                fix = "update the graphics driver, or open the file on another machine"
                raise MachineError(message, code="M1", where=str(file), fix=fix)
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
        The viewer's server, from which the page is made, did not come up.
    """
    import rerun as rr

    file = existing(rrd)
    script, binary = viewer_files()
    text = page(file.stem, file.read_bytes(), script, binary, rr.__version__)
    atomic_write(Path(out), text.encode())


def page(title: str, rrd: bytes, script: str, binary: bytes, version: str) -> str:
    """The page as text.

    Parameters
    ----------
    title : str
        Of the page.
    rrd : bytes
        Recording.
    script, binary : str, bytes
        JavaScript and WebAssembly of the viewer.
    version : str
        Of the viewer.
    """
    return Template(PAGE.read_text(encoding="utf-8")).substitute(
        title=escape(title),
        version=version,
        script=script.replace(*PLACED).replace("</script", "<\\/script"),
        wasm=base64.b64encode(gzip.compress(binary, 9, mtime=0)).decode(),
        rrd=base64.b64encode(rrd).decode(),
    )


def viewer_files() -> tuple[str, bytes]:
    """JavaScript and WebAssembly of the viewer for browsers, out of the installed package."""
    with serve() as address:
        script, binary = (_fetch(address + name) for name in ("re_viewer.js", "re_viewer_bg.wasm"))
    packed = binary[:2] == b"\x1f\x8b"
    return script.decode(), gzip.decompress(binary) if packed else binary


def existing(rrd: str | Path) -> Path:
    """Absolute path of a recording that is there."""
    path = Path(rrd).absolute()
    if not is_there(path, Path.is_file):
        message, fix = "no such recording", "truebed record RUN"
        raise refuse("rrd", code="F3", message=message, fix=fix, where=str(rrd))
    return path


def native() -> Path:
    """The binary of the viewer; the command beside Python's is a wrapper that leaves orphans."""
    import rerun_cli

    folder = Path(str(rerun_cli.__file__)).parent
    return folder / ("rerun.exe" if sys.platform == "win32" else "rerun")


@contextmanager
def headless(rrd: Path, size: tuple[int, int] = SIZE) -> Iterator[Any]:
    """Client of a viewer without a window, of so many points, that has loaded a recording."""
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
