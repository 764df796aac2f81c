"""The command, called within this process."""

from typer.testing import CliRunner

from testbed.cli import app


def call(*words):
    """What `truebed` with these words printed and how it ended; a defect of ours is raised."""
    return CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
