"""``{play}``: a command or a script on a page, run when the page is built, and what it printed.

All blocks of a page run in one folder of their own, in order, and Python keeps its names from block
to block. A block that fails fails the build, so that no page shows what does not work.
"""

import os
import select
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
import tty
from contextlib import chdir, redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

LOG = logging.getLogger(__name__)
LONGEST_S = 300
"""A block that takes longer has no place on a page."""
WIDTH = 96
"""Characters of a line that a page shows whole."""
LONGEST_WORD = 12
"""Characters a word, on average, beyond which a line is no sentence."""
PICTURES = "_pictures"
"""Where figures wait until Sphinx has copied them, below the pages."""


@dataclass
class Page:
    """The folder and the names of one page."""

    folder: Path
    names: dict[str, Any] = field(default_factory=lambda: {"__name__": "page"})


def page_of(pages: dict[str, Page], name: str) -> Page:
    """The page `name`, with an empty folder at first."""
    if name not in pages:
        pages[name] = Page(Path(tempfile.mkdtemp(prefix="truebed_page_")))
        # scripts stand where a reader in a clone has them
        (pages[name].folder / "scenes").symlink_to(Path(__file__).parents[2] / "scenes")
    return pages[name]


def shell(text: str, folder: Path) -> str:
    """What a shell script prints in a folder, with the truebed of this Python before others.

    It prints into a terminal of a page's width, so that tables fold as a reader's would, and into a
    dumb one, so that nothing moves or has a color.
    """
    environment = os.environ | {
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(sys.path[:3]),
        "OPENBLAS_NUM_THREADS": "1",
        "COLUMNS": str(WIDTH),
        "TERM": "dumb",
        "NO_COLOR": "1",
    }
    reader, terminal = os.openpty()
    tty.setraw(terminal)  # ends of lines stay as they are printed
    with subprocess.Popen(
        ["bash", "-euo", "pipefail", "-c", text], cwd=folder, env=environment,
        stdin=subprocess.DEVNULL, stdout=terminal, stderr=terminal,
    ) as ran:  # fmt: skip
        os.close(terminal)
        printed = _all_of(reader, ran)
    if ran.returncode:
        raise RuntimeError(f"exit code {ran.returncode}\n{printed}")
    return printed


def _all_of(reader: int, ran: "subprocess.Popen[bytes]") -> str:
    """What a process prints into a terminal until it ends."""
    parts, end = list[bytes](), time.monotonic() + LONGEST_S
    with os.fdopen(reader, "rb", buffering=0) as shown:
        while select.select([shown], [], [], max(end - time.monotonic(), 0.0))[0]:
            try:
                part = shown.read(65536)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            parts.append(part)
        else:
            ran.kill()
            raise TimeoutError(f"took longer than {LONGEST_S} s")
    return b"".join(parts).decode().expandtabs()


def folded(line: str) -> list[str]:
    """A sentence on lines of a page's width; rows of tables and of files as they are."""
    text = line.strip()
    is_prose = "  " not in text and text.count(" ") * LONGEST_WORD > len(text)
    if len(line) <= WIDTH or not is_prose:
        return [line]
    indent = line[: len(line) - len(line.lstrip())]
    return textwrap.wrap(
        text, WIDTH, initial_indent=indent, subsequent_indent=f"{indent}  ", break_long_words=False
    )


def python(text: str, page: Page) -> str:
    """What a Python script prints in the folder of its page, after the scripts before it."""
    printed = StringIO()
    with chdir(page.folder), redirect_stdout(printed):
        exec(compile(text, "page", "exec"), page.names)
    return printed.getvalue()


class Play(SphinxDirective):
    """A block of ``sh`` or ``python``, run; ``:figure:`` shows a picture that it drew."""

    has_content = True
    required_arguments = 1
    option_spec: ClassVar = {
        "figure": directives.unchanged,
        "alt": directives.unchanged,
        "silent": directives.flag,
        "hidden": directives.flag,
        "last": directives.positive_int,
    }
    pages: ClassVar[dict[str, Page]] = {}

    def run(self) -> list[nodes.Node]:
        """The script, what it printed and its figure."""
        language, text = self.arguments[0], "\n".join(self.content)
        page, began = page_of(self.pages, self.env.docname), time.monotonic()
        try:
            printed = shell(text, page.folder) if language == "sh" else python(text, page)
        except Exception as error:  # whatever it is, the page is wrong
            raise self.error(f"{language} block failed: {error!r}\n{error}\n{text}") from error
        LOG.info("%s: %s block in %.1f s", self.env.docname, language, time.monotonic() - began)
        found: list[nodes.Node] = []
        if "hidden" not in self.options:
            found.append(nodes.literal_block(text, text, language=language))
        lines = [part for line in printed.strip("\n").splitlines() for part in folded(line)]
        if lines and "silent" not in self.options:
            shown = "\n".join(lines[-self.options.get("last", len(lines)) :])
            found.append(
                nodes.literal_block(shown, shown, language="text", classes=["played-output"])
            )
        if "figure" in self.options:
            found.append(self._figure(page.folder / self.options["figure"]))
        return found

    def _figure(self, drawn: Path) -> nodes.container:
        """The picture, where Sphinx finds it, in a frame through which a phone scrolls."""
        name = f"{self.env.docname.replace('/', '-')}-{drawn.name}"
        kept = Path(self.env.srcdir) / PICTURES / name
        kept.parent.mkdir(exist_ok=True)
        shutil.copyfile(drawn, kept)
        image = nodes.image(
            uri=f"{'../' * self.env.docname.count('/')}{PICTURES}/{name}",
            alt=self.options["alt"], classes=["figure"],
        )  # fmt: skip
        return nodes.container("", image, classes=["drawn"])


def _forget(app: Sphinx, _doctree: nodes.document) -> None:
    """Remove the folder of a page that has been read."""
    page = Play.pages.pop(app.env.docname, None)
    if page is not None:
        shutil.rmtree(page.folder, ignore_errors=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Name the directive."""
    app.add_directive("play", Play)
    app.connect("doctree-read", _forget)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
