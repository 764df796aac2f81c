"""The verbs that begin: new proposes files from what is there, check reads one."""

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.app import Debug, Quiet, app
from testbed.cli.exit_codes import exit_codes
from testbed.cli.output import say

new = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Propose a file to begin with, from your own files: a session, a robot, a scene.",
)
app.add_typer(new, name="new")


@new.command()
def session(
    data: Annotated[
        list[Path],
        typer.Argument(metavar="DATA...", help="Tables, workbooks, exports, RAPID programs."),
    ],
    robot: Annotated[
        str | None,
        typer.Option(metavar="ROBOT", help="The robot that was measured: readings are tried."),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="FILE", help="File to write.")] = Path(
        "session.toml"
    ),
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Look at measurement files and write the session.toml that they are likely to need."""
    with exit_codes(debug=debug):
        from testbed.proposal.data import look_at
        from testbed.proposal.session import propose_session
        from testbed.proposal.text import session_text
        from testbed.proposal.write import require_new, write_new
        from testbed.robots.catalog import load_robot

        require_new(out)
        arm = load_robot(robot) if robot is not None else None
        looks = look_at(data, out.parent)
        proposed = propose_session(looks, arm, out.parent)
        write_new(out, session_text(proposed, looks, robot, str(out)))
        if not quiet:
            say(f"{proposed.tried}.")
            for sentence in proposed.assumed:
                say(f"  assumed  {sentence}")
            say()
            say(f"Session    {out}")
            say(f"Next       truebed identify {robot or 'ROBOT'} {out}")
