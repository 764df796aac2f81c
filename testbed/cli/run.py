"""Verbs that compute: run and plan play a scenario, identify calibrates from measurements."""

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.cli.app import Debug, Json, Quiet, app
from testbed.cli.exit_codes import SOME_FAILED, exit_codes
from testbed.cli.output import say, say_json, warn
from testbed.machine import COMPUTING

if TYPE_CHECKING:
    from testbed.scenario.scenario import Scenario

Scene = Annotated[str, typer.Argument(metavar="SCENE", help="A scene's name or a .toml file.")]
Seed = Annotated[int | None, typer.Option(help="Another seed.")]
Data = Annotated[
    Path, typer.Argument(metavar="DATA", help="A session.toml, or a table: CSV, xlsx.")
]
MaxMb = Annotated[float, typer.Option("--max-mb", help="Largest file read [MB].")]
Workers = Annotated[
    str, typer.Option(metavar="N", help="Processes that play robots; auto: one a core.")
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Rename an old run of that name first.")
]


@app.command()
def run(
    scene: Scene,
    out: Annotated[Path | None, typer.Option(help="Folder [runs/SCENE-seedN].")] = None,
    seed: Seed = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a stopped run.")] = False,
    overwrite: Overwrite = False,
    export: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the measurements as files for identify, too."),
    ] = None,
    workers: Workers = "1",
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Play a whole virtual campaign and write its run folder."""
    with exit_codes(debug=debug, as_json=as_json, room=COMPUTING) as end:
        scenario, where = scenario_of(scene, seed)
        folder = out or default_folder(scenario)
        end.folder = folder
        words = ["truebed", "run", scene, "--out", str(folder)]
        words += [] if seed is None else ["--seed", str(seed)]
        if export is not None:
            from testbed.files.session_toml import SESSION_FILE
            from testbed.store.whole_folder import check_free

            check_free(export, SESSION_FILE, overwrite=overwrite)
            words += ["--export", str(export)]
        processes = workers_asked(workers, quiet=quiet or as_json)
        words += [] if processes == 1 else ["--workers", workers]
        end.resume = [*words, "--resume"]
        from testbed.cli.terminal import headline, progress
        from testbed.engines.choice import engine_of
        from testbed.run.play import play_run, robot_of
        from testbed.run.result import read_result

        engine = engine_of(processes)
        with progress(quiet=quiet or as_json) as report, closing(engine):
            outcome = play_run(
                scenario,
                folder,
                resume=resume,
                overwrite=overwrite,
                progress=report,
                where=where,
                engine=engine,
            )
        end.code = SOME_FAILED if outcome.failed else end.code
        if export is not None:
            from testbed.run.export import export_campaign

            arm = robot_of(scenario, where)
            export_campaign(outcome.campaign, arm, export, overwrite=overwrite)
        if as_json:
            say_json((folder / "result.json").read_text(encoding="utf-8").rstrip())
        elif not quiet:
            say(headline(read_result(folder)))
            say()
            say(f"Report     {folder / 'report.html'}")
            if export is not None:
                say(f"Exported   {export / SESSION_FILE}")
            say(f"Next       truebed view {folder}")


@app.command()
def plan(
    scene: Scene,
    out: Annotated[Path | None, typer.Option(help="Folder [runs/SCENE-seedN-plan].")] = None,
    seed: Seed = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Rename an old plan of that name first.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Choose poses for a real robot: what to measure, in what order, what will come out."""
    with exit_codes(debug=debug, as_json=as_json, room=COMPUTING) as end:
        scenario, where = scenario_of(scene, seed)
        default = default_folder(scenario)
        folder = out or default.with_name(f"{default.name}-plan")
        from testbed.cli.terminal import progress
        from testbed.plan.folder import RECORDING, REPORT, play_plan
        from testbed.plan.words import terminal_text
        from testbed.store.layout import PLAN

        with progress(quiet=quiet or as_json) as tell:
            made = play_plan(scenario, folder, overwrite=overwrite, progress=tell, where=where)
        end.code = SOME_FAILED if made.tour.blocked else end.code
        if as_json:
            say_json((folder / PLAN).read_text(encoding="utf-8").rstrip())
        elif not quiet:
            say(terminal_text(made))
            say()
            say(f"Report     {folder / REPORT}")
            say(f"Next       truebed view {folder / RECORDING}")


@app.command()
def identify(
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="A shipped robot, robot.toml, URDF or MJCF file.")
    ],
    data: Data,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Names and units of the columns of a foreign CSV."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder [runs/DATA-identified].")] = None,
    train: Annotated[
        int | None, typer.Option(metavar="N", help="Poses to identify from; the rest is held out.")
    ] = None,
    held_out: Annotated[
        int | None,
        typer.Option(metavar="N", help="Poses to hold out; the rest identifies. 0: no proof."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Draws which poses are held out.")] = 0,
    test: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Held-out poses in a file of their own.")
    ] = None,
    model: Annotated[
        str | None, typer.Option(help="geometric, extended or choose [as the session says].")
    ] = None,
    loss: Annotated[
        str, typer.Option(help="auto leaves gross errors out; or squared, huber, cauchy.")
    ] = "auto",
    program: Annotated[
        Path | None, typer.Option(metavar="CSV", help="Joint or Cartesian targets to correct.")
    ] = None,
    package: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="ROS package that the URDF's meshes will lie in."),
    ] = None,
    tip: Annotated[
        str | None, typer.Option(metavar="LINK", help="Last link of a URDF or MJCF with several.")
    ] = None,
    mesh_root: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder that meshes may lie in.")
    ] = None,
    allow_missing_meshes: Annotated[
        bool, typer.Option("--allow-missing-meshes", help="Draw links without their meshes.")
    ] = False,
    drop_invalid: Annotated[
        bool, typer.Option("--drop-invalid", help="Leave rows out that are not numbers.")
    ] = False,
    max_mb: MaxMb = 100.0,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Calibrate a robot from measurements: parameters, a corrected model, proof on other poses.

    Several visits of one robot are [[session]] tables of one session.toml. There
    [identification] free = "frames" places a calibrated robot anew: base and tool alone are fitted.
    """
    with exit_codes(debug=debug, as_json=as_json, room=COMPUTING) as end:
        from testbed.cli.terminal import progress
        from testbed.files.read import ReadOptions, read_held_out, read_session
        from testbed.identify.calibrate import Options
        from testbed.identify.folder import check_place, play_calibration
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
        with progress(quiet=quiet or as_json) as tell:
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
            say(terminal_text(calibration, delivered))
            say()
            say(f"Report     {folder / REPORT}")
            say(f"Robot      {folder / 'robot'}")
            say(f"Next       truebed view {folder}")


@app.command()
def iso9283(
    data: Data,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A session.toml on how to read a table."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder [runs/DATA-iso9283].")] = None,
    drop_invalid: Annotated[
        bool,
        typer.Option(
            "--drop-invalid",
            help="Leave rows out that are not numbers, and cycles that are not whole.",
        ),
    ] = False,
    max_mb: MaxMb = 100.0,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Test a real robot after ISO 9283: accuracy and repeatability from measured cycles."""
    with exit_codes(debug=debug, as_json=as_json, room=COMPUTING):
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
            say(terminal_text(result))
            say()
            say(f"Figures    {folder / ISO9283}")
            say(f"Report     {folder / REPORT}")


def scenario_of(scene: str, seed: int | None) -> "tuple[Scenario, str]":
    """A scene with another seed, if there is one, and what to call it in messages."""
    from testbed.scenario.read import changed, scenario_path
    from testbed.studies import load_scenario

    where = scenario_path(scene)[1]
    scenario = load_scenario(scene)
    if seed is not None:
        scenario = changed(scenario, {"seed": seed}, where="--seed")
    return scenario, where


def workers_asked(text: str, *, quiet: bool) -> int:
    """The processes that --workers asks for; said, if they are more than cores."""
    from testbed.engines.choice import crowded, workers_of

    workers = workers_of(text)
    if not quiet and (told := crowded(workers)):
        warn(told)
    return workers


def default_folder(scenario: "Scenario") -> Path:
    """Where a run goes unless --out says otherwise."""
    return Path("runs") / f"{scenario.name}-seed{scenario.seed}"


def folder_of(data: Path, ending: str) -> Path:
    """Where a result goes unless --out says otherwise."""
    from testbed.files.session_toml import SESSION_FILE
    from testbed.gates.paths import real

    found = real(data, field="measurements", code="S37")
    name = found.parent.name if data.name == SESSION_FILE else data.stem
    return Path("runs") / f"{name}-{ending}"
