"""The pages load nothing from a network, so that they can be read where there is none."""

import re
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util import logging

LOG = logging.getLogger(__name__)
LOADED = re.compile(
    r"""<(?:script|img|iframe|link)\b[^>]*\b(?:src|href)=["'](?:https?:)?//[^"']*"""
    r"""|url\(["']?(?:https?:)?//|@import ["'](?:https?:)?//"""
)
"""What a browser fetches by itself; a link that a reader may follow is none of it."""


def _checked(app: Sphinx, error: Exception | None) -> None:
    """One warning for every page or style sheet that loads from elsewhere."""
    if error is not None or app.builder.format != "html":
        return
    for path in sorted(Path(app.outdir).rglob("*")):
        if path.suffix in (".html", ".css"):
            for found in LOADED.findall(path.read_text(encoding="utf-8")):
                LOG.warning("%s loads from a network: %s", path.name, found)


def setup(app: Sphinx) -> dict[str, bool]:
    """Look when all is written."""
    app.connect("build-finished", _checked)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
