"""The command `truebed`: all its verbs, each in the module of its kind; no science."""

# the order of these is the order of the verbs in --help
from testbed.cli import campaign, plan, measured, new, look  # noqa: I001  # not the alphabet
from testbed.cli.app import app as app

__all__ = ["app", "campaign", "look", "measured", "new", "plan"]
