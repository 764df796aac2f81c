"""A report to hand out: printed to PDF by an installed browser, or with its recording in it."""

import os
import shutil
import subprocess
import tempfile
from html import escape
from pathlib import Path

from calib.errors import MachineError, refuse
from testbed.disk import atomic_write

BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "microsoft-edge",
    "msedge",
    "chrome",
)
"""Browsers that print without a window; the first one on PATH does."""
LIMIT = 120.0
"""Longest wait for a browser [s]."""
FRAME = (
    '<section id="recording"><details><summary><h2>Recording</h2></summary>'
    '<iframe title="Recording" loading="lazy" style="width:100%;height:75vh;border:0" '
    'srcdoc="{page}"></iframe></details></section>\n<footer'
)


def browser() -> str | None:
    """A browser that prints pages, or None."""
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)


def require_browser() -> str:
    """The same, refused before anything is written.

    Raises
    ------
    InputError
        C42: there is none.
    """
    found = browser()
    if found is None:
        message = f"--pdf needs a browser to print with, and PATH has none of {', '.join(BROWSERS)}"
        fix = "install Chromium, or open report.html in any browser and print it"
        raise refuse("--pdf", code="C42", message=message, fix=fix)
    return found


def print_pdf(page: Path, by: str) -> Path:
    """Print a page to the PDF beside it.

    Parameters
    ----------
    page : Path
        HTML that needs nothing from outside.
    by : str
        Path of a browser.

    Raises
    ------
    MachineError
        M1: the browser failed, or printed nothing in time.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        out = Path(name, "out.pdf")
        words = ["--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer"]
        words += [f"--user-data-dir={name}", f"--print-to-pdf={out}", page.absolute().as_uri()]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            words.insert(0, "--no-sandbox")  # browsers refuse a sandbox to root
        try:
            subprocess.run([by, *words], capture_output=True, timeout=LIMIT, check=True)
            printed = out.read_bytes()
        except (OSError, subprocess.SubprocessError) as error:
            message, fix = f"{by} did not print the page", f"open {page} in a browser and print it"
            raise MachineError(message, code="M1", where=str(page), fix=fix) from error
    pdf = page.with_suffix(".pdf")
    atomic_write(pdf, printed)
    return pdf


def with_recording(page: Path, recording: Path) -> Path:
    """Write a report once more, its recording and a viewer of it in a folded section at the end."""
    from testbed.cli.viewer import html_page

    with tempfile.TemporaryDirectory() as name:
        player = Path(name, f"{recording.stem}.html")
        html_page(recording, player)
        inside = escape(player.read_text(encoding="utf-8"))
    text = page.read_text(encoding="utf-8")
    text = text.replace(f'href="{recording.name}"', 'href="#recording"')
    head, _, rest = text.rpartition("<footer")
    out = page.with_name(f"{page.stem}_with_recording.html")
    atomic_write(out, (head + FRAME.replace("{page}", inside) + rest).encode())
    return out
