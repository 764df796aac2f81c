"""The command `truebed`: all its verbs, each in the module of its kind; no science."""

# the order of these is the order of the verbs in --help
from testbed import cli_play, cli_identify, cli_look  # noqa: I001  # not the alphabet
from testbed.cli_app import app as app

__all__ = ["app", "cli_identify", "cli_look", "cli_play"]
