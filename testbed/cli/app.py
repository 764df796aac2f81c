"""The application that the verbs join, and the options that they share."""

from io import StringIO
from pathlib import Path
from typing import Annotated, cast

import typer
from typer.exceptions import TyperException

from testbed.cli.output import say, warn

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="A metrology laboratory for robot arms. Virtual robots: know the truth, and see how close "
    "calibration comes. Real robots: identify them from measurements, with proof on other poses.",
    epilog="Start with: truebed run quick",
)


def scenes_like(incomplete: str) -> list[str]:
    """Scenes that ship whose names begin so, for the shell; files it completes itself."""
    from testbed.assets import scene_names

    return [name for name in scene_names() if name.startswith(incomplete)]


def robots_like(incomplete: str) -> list[str]:
    """Robots that ship whose names begin so."""
    from testbed.assets import robot_names

    return [name for name in robot_names() if name.startswith(incomplete)]


Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, even for errors.")]
Plain = Annotated[
    bool,
    typer.Option("--plain", help="For screen readers: no drawn lines, no bar, one fact per line."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Tip = Annotated[
    str | None, typer.Option(metavar="LINK", help="Last link, if the file has several ends.")
]
MeshRoot = Annotated[
    Path | None, typer.Option("--mesh-root", metavar="DIR", help="Folder that holds all meshes.")
]
Meshless = Annotated[
    bool, typer.Option("--allow-missing-meshes", help="Draw links without their meshes.")
]
Run = Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")]


def show_version(value: bool) -> None:
    """Print the version and end."""
    if value:
        from testbed.versions import own_version

        say(f"truebed {own_version()}")
        raise typer.Exit


@app.callback()
def top(
    version: Annotated[
        bool,
        typer.Option("--version", callback=show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Keep the verbs apart from the options of the command itself."""


def answer() -> int:
    """Run the verb that the command line names; the exit code."""
    try:
        code = app(prog_name="truebed", windows_expand_args=False, standalone_mode=False)
    except TyperException as error:  # of usage: it repeats words of the command line
        told = StringIO()
        cast("typer.BadParameter", error).show(told)  # all that an application raises have it
        warn(told.getvalue().rstrip())
        return error.exit_code
    return int(code or 0)
