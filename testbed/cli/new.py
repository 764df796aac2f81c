"""The verbs that begin: new proposes files, check reads one, schema tells editors of them."""

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.app import Debug, Json, Meshless, MeshRoot, Plain, Quiet, Tip, app, robots_like
from testbed.cli.exit_codes import exit_codes
from testbed.cli.output import say, say_found, say_json, say_next

Out = Annotated[Path, typer.Option(metavar="FILE", help="File to write.")]

new = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Propose a file to start from: a session, a robot or a scene.",
)
app.add_typer(new, name="new")


@new.command()
def session(
    data: Annotated[
        list[Path],
        typer.Argument(metavar="DATA...", help="Tables, workbooks, exports, robot programs."),
    ],
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help="The measured robot, to try units and conventions.",
            autocompletion=robots_like,
        ),
    ] = None,
    tip: Tip = None,
    out: Out = Path("session.toml"),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="First rename an old file of that name.")
    ] = False,
    quiet: Quiet = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Write the session.toml that measurement files are likely to need."""
    with exit_codes(debug=debug, plain=plain):
        from testbed.proposal.data import look_at
        from testbed.proposal.own_outputs import without_ours
        from testbed.proposal.rows.krl_lists import without_programs
        from testbed.proposal.session import propose_session
        from testbed.proposal.text import next_command, session_text
        from testbed.proposal.write import move_aside, require_folder, require_new, write_new
        from testbed.robots.catalog import load_robot
        from testbed.schemas.editor import schema_beside

        require_folder(out)
        arm = None  # nothing is drawn here
        if robot is not None:
            arm = load_robot(robot, tip=tip, allow_missing_meshes=True)
        bare = arm is not None and arm.lacks_meshes
        given, ours = without_ours(data)
        given, programs = without_programs(given)
        looks = look_at(given, out.parent)
        if not overwrite:
            require_new(out, renames=True)
        proposed = propose_session(looks, arm, out.parent, (*ours, *programs))
        named = arm.name if arm else None
        text = session_text(proposed, looks, str(out), robot, named, tip, lacks_meshes=bare)
        if overwrite:
            move_aside(out)
        write_new(out, (line := schema_beside(out, "session")) + text)
        if not quiet:
            say_found(f"{proposed.tried}.")
            for label, sentences in (
                ("assumed", proposed.assumed),
                ("unused", proposed.unused),
                ("odd", proposed.odd),
                ("to fix", proposed.to_mend),
            ):
                for sentence in sentences:
                    say_found(f"  {label:7}  {sentence}")
            say()
            say(f"Session    {out}")
            tell_schema(out, line)
            command = next_command(proposed, str(out), robot, tip, lacks_meshes=bare)
            say(f"Next       {command}")


@new.command()
def robot(
    table: Annotated[
        Path | None,
        typer.Argument(
            metavar="TABLE",
            help="Link numbers: columns theta, d, a, alpha; limits. Or a URDF or MJCF.",
        ),
    ] = None,
    joints: Annotated[
        int,
        typer.Option(metavar="N", min=1, max=64, help="Number of joints, if there is no table."),
    ] = 6,
    tip: Tip = None,
    mesh_root: MeshRoot = None,
    allow_missing_meshes: Meshless = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="File to write (robot.toml); of a URDF or MJCF, a folder."
        ),
    ] = None,
    quiet: Quiet = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Write a robot.toml, of a table of links, a URDF, or to fill in."""
    with exit_codes(debug=debug, plain=plain):
        from testbed.proposal.robot import robot_text
        from testbed.proposal.write import plain_name, require_new, write_new
        from testbed.robots.describe.xml_gate import FileOptions
        from testbed.robots.write.described import of_description
        from testbed.schemas.editor import schema_beside

        options = FileOptions(tip, mesh_root, allow_missing_meshes)
        if (described := of_description(table, options, out)) is not None:
            written, frames = described
            if not quiet:
                say(f"Robot      {written}")
                for sentence in frames:
                    say(f"  frames   {sentence}")
                say_next("truebed", "check", written)
            return
        out = Path("robot.toml") if out is None else out
        require_new(out)
        name = plain_name(table if table is not None else out)
        text, assumed = robot_text(table, joints, name)
        write_new(out, (line := schema_beside(out, "robot")) + text)
        if not quiet:
            for sentence in assumed:
                say(f"  assumed  {sentence}")
            say(f"Robot      {out}")
            tell_schema(out, line)
            say_next("truebed", "check", out)


@new.command()
def scene(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT",
            help="A shipped robot, robot.toml, URDF or MJCF.",
            autocompletion=robots_like,
        ),
    ],
    tip: Tip = None,
    mesh_root: MeshRoot = None,
    allow_missing_meshes: Meshless = False,
    out: Out = Path("scene.toml"),
    quiet: Quiet = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Write a scenario for a robot, with its work box and a tracker.

    A scenario names a file as it is: if a tip or meshes have to be told, the robot is written
    beside it, as robot.toml.
    """
    with exit_codes(debug=debug, plain=plain):
        from testbed.proposal.scene import scene_text
        from testbed.proposal.write import plain_name, require_new, seen_from, write_new
        from testbed.robots.catalog import load_robot
        from testbed.robots.write.folder import write_robot_folder
        from testbed.schemas.editor import schema_beside

        require_new(out)
        arm = load_robot(
            robot, tip=tip, mesh_root=mesh_root, allow_missing_meshes=allow_missing_meshes
        )
        if told := tip is not None or mesh_root is not None or arm.lacks_meshes:
            folder = out.parent / arm.name
            write_robot_folder(arm, folder)
            robot = str(folder)
        text = scene_text(arm, seen_from(out, robot), plain_name(out))
        write_new(out, (line := schema_beside(out, "scene")) + text)
        if not quiet:
            say(f"Scene      {out}")
            if told:
                say(f"Robot      {robot}")
            tell_schema(out, line)
            say_next("truebed", "run", out)


def tell_schema(out: Path, line: str) -> None:
    """Say which schema was written beside a file, if there was."""
    if line:
        say(f"Schema     {out.parent / line.split()[1]}  for editors")


@app.command()
def check(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Session, scenario, robot, or a table of data.")
    ],
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help="Robot that the joint values belong to.",
            autocompletion=robots_like,
        ),
    ] = None,
    tip: Tip = None,
    as_json: Json = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Read a whole file, say what it is and what looks wrong. Nothing is computed."""
    with exit_codes(debug=debug, plain=plain, as_json=as_json):
        from testbed.proposal.check import checked

        said = checked(file, robot, tip)
        if as_json:
            import json

            say_json(json.dumps({"file": str(file), "sentences": said}, ensure_ascii=False))
            return
        say_found("\n  ".join([f"{file}: {said[0]}", *said[1:]]))


@app.command()
def schema(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="scene, session, robot or tracker.",
            autocompletion=lambda: ["scene", "session", "robot", "tracker"],
        ),
    ],
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Print the JSON Schema of a TOML file, for editors.

    Editors use it to complete and check keys.
    """
    with exit_codes(debug=debug, plain=plain):
        from testbed.schemas.editor import schema_text

        say(schema_text(file).rstrip())
