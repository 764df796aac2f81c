"""The documents: Sphinx settings. Nothing is fetched from a network, to build or to read."""

import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).parent
ROOT = HERE.parent
# the checkout itself is described, whatever is installed
sys.path[:0] = [str(HERE), str(ROOT), str(ROOT / "testbed" / "front")]

project = "truebed"
author = "The truebed authors"
project_copyright = author
release = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "made.formats",
    "made.formulas",
    "made.gallery",
    "made.offline",
    "made.outputs",
    "made.played",
]
exclude_patterns = ["_build"]
nitpicky = True
html_math_renderer = "mathml"

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"truebed {release}"
html_static_path = ["static"]
html_css_files = ["truebed.css"]
html_show_sphinx = False
html_copy_source = False
pygments_style = "friendly"
pygments_dark_style = "github-dark"


_AS_WRITTEN: dict[str, list[str]] = {}


def _kept(_app: Any, what: str, name: str, _thing: Any, _how: Any, lines: list[str]) -> None:
    """Remember the docstring of an attribute."""
    if what in ("attribute", "property"):
        _AS_WRITTEN[name] = list(lines)


def _restored(
    _app: Any, _what: str, name: str, _thing: Any, _options: Any, lines: list[str]
) -> None:
    """Take it back: napoleon takes words before a colon for the type of the attribute."""
    if name in _AS_WRITTEN:
        lines[:] = _AS_WRITTEN.pop(name)


def setup(app: "Sphinx") -> None:
    """Look at docstrings before napoleon and after it, which has priority 500."""
    app.connect("autodoc-process-docstring", _kept, priority=100)
    app.connect("autodoc-process-docstring", _restored, priority=900)
