"""Verbs that take measurements of a real robot: identify and iso9283."""

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.app import Debug, Json, Meshless, MeshRoot, Plain, Quiet, Tip, app, robots_like
from testbed.cli.campaign import Overwrite
from testbed.cli.exit_codes import SOME_FAILED, exit_codes
from testbed.cli.output import say, say_found, say_json, say_next
from testbed.machine import COMPUTING

Data = Annotated[
    Path, typer.Argument(metavar="DATA", help="A session.toml, or a table: CSV, xlsx.")
]
MaxMb = Annotated[float, typer.Option("--max-mb", help="Largest file that is read [MB].")]


@app.command()
def identify(
    robot: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT",
            help="A shipped robot, robot.toml, URDF or MJCF file.",
            autocompletion=robots_like,
        ),
    ],
    data: Data,
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File with names and units of the columns.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Output folder [runs/DATA-identified].")] = None,
    train: Annotated[
        int | None, typer.Option(metavar="N", help="Poses to identify from; the rest are held out.")
    ] = None,
    held_out: Annotated[
        int | None,
        typer.Option(metavar="N", help="Poses to hold out; the rest identify. 0: no proof."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed for drawing the held-out poses.")] = 0,
    test: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Held-out poses in a separate file.")
    ] = None,
    model: Annotated[
        str | None, typer.Option(help="geometric, extended or choose [as the session says].")
    ] = None,
    loss: Annotated[
        str, typer.Option(help="auto (leaves gross errors out), squared, huber or cauchy.")
    ] = "auto",
    program: Annotated[
        Path | None, typer.Option(metavar="CSV", help="Joint or Cartesian targets to correct.")
    ] = None,
    package: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="ROS package that will hold the URDF's meshes."),
    ] = None,
    tip: Tip = None,
    mesh_root: MeshRoot = None,
    allow_missing_meshes: Meshless = False,
    drop_invalid: Annotated[
        bool, typer.Option("--drop-invalid", help="Leave out rows that are not numbers.")
    ] = False,
    max_mb: MaxMb = 100.0,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    as_json: Json = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Calibrate a robot from measurements, with proof on other poses.

    The folder will hold parameters, the corrected robot, corrected programs, and a report.

    Several visits to one robot are [[session]] tables in one session.toml. For a calibrated robot
    that was moved, [identification] free = "frames" fits only base and tool.
    """
    with exit_codes(debug=debug, plain=plain, as_json=as_json, room=COMPUTING) as end:
        from testbed.cli.terminal import progress
        from testbed.files.read import ReadOptions, read_held_out, read_session
        from testbed.identify.calibrate import Options
        from testbed.identify.folder import check_place, play_calibration
        from testbed.identify.given import require_order
        from testbed.identify.handback.delivered import GEOMETRIC
        from testbed.identify.session import with_test
        from testbed.identify.splitting import all_identify
        from testbed.identify.words import terminal_text
        from testbed.robots.catalog import load_robot
        from testbed.robots.write.urdf import require_package
        from testbed.store.layout import REPORT, RESULT

        if package is not None:
            require_package(package)
        folder = out or folder_of(data, "identified")
        check_place(folder, overwrite=overwrite)
        require_order(robot, data)
        arm = load_robot(
            robot, tip=tip, mesh_root=mesh_root, allow_missing_meshes=allow_missing_meshes
        )
        how = ReadOptions(drop_invalid=drop_invalid, max_mb=max_mb)
        session = read_session(data, arm, config=config, options=how)
        if test is not None:
            all_identify(train, held_out)
            apart = read_held_out(test, arm, data, config=config, options=how)
            session = with_test(session, apart)
        options = Options(train=train, held_out=held_out, seed=seed, model=model, loss=loss)
        with progress(f"identify {session.name}", quiet=quiet or as_json) as tell:
            calibration, delivered = play_calibration(
                arm,
                session,
                folder,
                options,
                program=program,
                package=package,
                overwrite=overwrite,
                progress=tell,
            )
        end.folder = folder
        sound = calibration.converged and not delivered.program_failed
        end.code = end.code if sound else SOME_FAILED
        if as_json:
            say_json((folder / RESULT).read_text(encoding="utf-8").rstrip())
        elif not quiet:
            say_found(terminal_text(calibration, delivered), good=calibration.settled)
            say()
            say(f"Report     {folder / REPORT}")
            say(f"Robot      {folder / 'robot'}")
            if (folder / GEOMETRIC).is_dir():
                say(f"URDF, MJCF {folder / GEOMETRIC}  fitted without joint terms")
            kind, own = delivered.own_file
            if own:
                say(f"Your {kind}  {folder / own}  in place of {robot}")
            say_next("truebed", "view", folder)


@app.command()
def iso9283(
    data: Data,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A session.toml that says how to read a table."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Output folder [runs/DATA-iso9283].")] = None,
    drop_invalid: Annotated[
        bool,
        typer.Option(
            "--drop-invalid", help="Leave out rows that are not numbers, and incomplete cycles."
        ),
    ] = False,
    max_mb: MaxMb = 100.0,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    as_json: Json = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Test a real robot after ISO 9283 from measured cycles.

    Accuracy and repeatability of poses and distances, drift, and paths.
    """
    with exit_codes(debug=debug, plain=plain, as_json=as_json, room=COMPUTING):
        from testbed.files.read import ReadOptions
        from testbed.iso9283.folder import check_place, play_iso9283, terminal_text
        from testbed.iso9283.read import read_test
        from testbed.store.layout import ISO9283, REPORT, RESULT

        folder = out or folder_of(data, "iso9283")
        check_place(folder, overwrite=overwrite)
        how = ReadOptions(drop_invalid=drop_invalid, max_mb=max_mb)
        result = play_iso9283(
            read_test(data, config=config, options=how), folder, overwrite=overwrite
        )
        if as_json:
            say_json((folder / RESULT).read_text(encoding="utf-8").rstrip())
        elif not quiet:
            say_found(terminal_text(result))
            say()
            say(f"Figures    {folder / ISO9283}")
            say(f"Report     {folder / REPORT}")
            say_next("truebed", "view", folder)


def folder_of(data: Path, ending: str) -> Path:
    """Where a result goes unless --out says otherwise."""
    from testbed.files.session_toml import SESSION_FILE
    from testbed.gates.paths import is_there, real

    found = real(data, field="measurements", code="S37")
    name = found.parent.name if data.name == SESSION_FILE else data.stem
    if is_there(data, Path.is_dir):  # "." has no name of its own
        name = found.name
    return Path("runs") / f"{name}-{ending}"
