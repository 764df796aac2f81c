"""The verbs of `truebed`: parse, call, print, exit code; no science."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.guard import SOME_FAILED, guarded, say, warn

if TYPE_CHECKING:
    from testbed.scenario import Scenario

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="A virtual metrology laboratory for robot arms: know the truth, and see how close "
    "calibration comes. All results are simulated.",
    epilog="Begin with: truebed run quick",
)

Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, also for errors.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
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
        bool, typer.Option("--version", callback=show_version, is_eager=True, help="Show it.")
    ] = False,
) -> None:
    """Keep the verbs apart from the options of the command itself."""


@app.command()
def run(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene's name or a .toml file.")],
    out: Annotated[Path | None, typer.Option(help="Folder [runs/SCENE-seedN].")] = None,
    seed: Annotated[int | None, typer.Option(help="Another seed.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a stopped run.")] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Rename an old run of that name first.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Play a whole virtual campaign and write its run folder."""
    with guarded(debug=debug, as_json=as_json) as guard:
        from testbed.scenario import changed, load_scenario, scenario_path

        where = scenario_path(scene)[1]
        scenario = load_scenario(scene)
        if seed is not None:
            scenario = changed(scenario, {"seed": seed}, where="--seed")
        folder = out or default_folder(scenario)
        guard.folder = folder
        words = ["truebed", "run", scene, "--out", str(folder)]
        words += [] if seed is None else ["--seed", str(seed)]
        guard.resume = [*words, "--resume"]
        from testbed.archive import read_result
        from testbed.runner import play_run
        from testbed.screen import headline, progress

        with progress(quiet=quiet or as_json) as report:
            outcome = play_run(
                scenario,
                folder,
                resume=resume,
                overwrite=overwrite,
                progress=report,
                where=where,
            )
        guard.code = SOME_FAILED if outcome.failed else guard.code
        if as_json:
            say((folder / "result.json").read_text(encoding="utf-8").rstrip())
        elif not quiet:
            say(headline(read_result(folder)))
            say()
            say(f"Report     {folder / 'report.html'}")
            say(f"Next       truebed view {folder}")


@app.command()
def plan(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene's name or a .toml file.")],
    out: Annotated[Path | None, typer.Option(help="Folder [runs/SCENE-seedN-plan].")] = None,
    seed: Annotated[int | None, typer.Option(help="Another seed.")] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Rename an old plan of that name first.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Choose poses for a real robot: what to measure, in what order, what will come out."""
    with guarded(debug=debug, as_json=as_json) as guard:
        from testbed.scenario import changed, load_scenario, scenario_path

        where = scenario_path(scene)[1]
        scenario = load_scenario(scene)
        if seed is not None:
            scenario = changed(scenario, {"seed": seed}, where="--seed")
        default = default_folder(scenario)
        folder = out or default.with_name(f"{default.name}-plan")
        from testbed.output.plan_files import play_plan
        from testbed.output.plan_folder import PLAN, RECORDING, REPORT
        from testbed.output.plan_words import terminal_text
        from testbed.screen import progress

        with progress(quiet=quiet or as_json) as tell:
            made = play_plan(scenario, folder, overwrite=overwrite, progress=tell, where=where)
        guard.code = SOME_FAILED if made.tour.blocked else guard.code
        if as_json:
            say((folder / PLAN).read_text(encoding="utf-8").rstrip())
        elif not quiet:
            say(terminal_text(made))
            say()
            say(f"Report     {folder / REPORT}")
            say(f"Next       truebed view {folder / RECORDING}")


def default_folder(scenario: "Scenario") -> Path:
    """Where a run goes unless --out says otherwise."""
    return Path("runs") / f"{scenario.name}-seed{scenario.seed}"


@app.command()
def scenes(
    name: Annotated[str | None, typer.Argument(help="Show this one in full.")] = None,
    debug: Debug = False,
) -> None:
    """List the scenes that ship, or show one with every default written out."""
    with guarded(debug=debug):
        from testbed.assets import scene_names
        from testbed.scenario import dump_scenario, load_scenario

        if name is not None:
            say(dump_scenario(load_scenario(name)).rstrip())
            return
        from testbed.screen import table

        rows = []
        for known in scene_names():
            scene = load_scenario(known)
            trials = ", ".join(trial.name for trial in scene.trial)
            rows.append([known, scene.robot, scene.title, trials])
        say(table("", ("scene", "robot", "what", "trials"), rows, wrap=True))
        say("\nPlay one: truebed run SCENE")


@app.command()
def robots(
    name: Annotated[str | None, typer.Argument(help="Show this one in full.")] = None,
    debug: Debug = False,
) -> None:
    """List the robots that ship, or show one."""
    with guarded(debug=debug):
        from testbed.robots.catalog import load_robot, robot_names
        from testbed.screen import robot_text, table

        if name is not None:
            say(robot_text(load_robot(name)))
            return
        found = [load_robot(known) for known in robot_names()]
        rows = [[r.name, r.title, str(r.model.chain.n_joints), str(r.folder)] for r in found]
        say(table("", ("robot", "title", "joints", "folder"), rows))


@app.command()
def compare(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN RUN...", help="Run folders.")],
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Put several runs into one table, and say which are equal byte for byte."""
    with guarded(debug=debug, as_json=as_json):
        from testbed.archive import equal_runs, read_result
        from testbed.screen import HEAD, headline_rows, table

        results = [read_result(path) for path in runs]
        equal = equal_runs(runs)
        if as_json:
            import json

            document = {str(path): result for path, result in zip(runs, results, strict=True)}
            groups = [[str(path) for path in group] for group in equal]
            say(json.dumps({"runs": document, "equal_bytes": groups}, ensure_ascii=False))
            return
        rows = [
            [str(path), result["scenario"], str(result["seed"]), *row]
            for path, result in zip(runs, results, strict=True)
            for row in headline_rows(result)
        ]
        say(results[0]["notice"])
        say(table("Tool error on held-out poses", ("run", "scenario", "seed", *HEAD), rows))
        for group in equal:
            say(f"Equal byte for byte: {', '.join(str(path) for path in group)}")
        if len(runs) > 1 and not equal:
            say("No two of these runs are equal.")


@app.command()
def report(folder: Run, debug: Debug = False) -> None:
    """Write result.json, arrays.npz and report.html again from the records."""
    with guarded(debug=debug) as guard:
        from testbed.archive import rederive
        from testbed.output.layout import ARRAYS, REPORT, RESULT

        guard.folder = folder
        rederive(folder, (RESULT, ARRAYS, REPORT))
        say(str(folder / REPORT))


@app.command()
def record(folder: Run, debug: Debug = False) -> None:
    """Write the recording again from the records."""
    with guarded(debug=debug) as guard:
        from testbed.archive import rederive
        from testbed.output.layout import RECORDING

        guard.folder = folder
        rederive(folder, (RECORDING,))
        say(str(folder / RECORDING))


@app.command()
def view(
    folder: Run,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Make a picture, open no window.")
    ] = None,
    step: Annotated[int | None, typer.Option(help="Step of the story in the picture.")] = None,
    html: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Make one page for browsers.")
    ] = None,
    debug: Debug = False,
) -> None:
    """Open the recording of a run, or make a picture or a page of it."""
    with guarded(debug=debug):
        from testbed.archive import recording_of
        from testbed.output import viewer

        file = recording_of(folder)
        check_view(picture, html, step)
        if picture is not None:
            viewer.picture(file, picture, step=step)
            say(str(picture))
        if html is not None:
            viewer.html_page(file, html)
            say(str(html))
        if picture is None and html is None:
            viewer.open_viewer(file, warn)


def check_view(picture: Path | None, html: Path | None, step: int | None) -> None:
    """Refuse a picture or page that cannot be written, before a viewer is started."""
    from calib.errors import InputError

    for option, path, suffix in (("--picture", picture, ".png"), ("--html", html, ".html")):
        if path is None:
            continue
        if path.suffix != suffix:
            raise InputError(
                f"{option} is {path}", code="C41", field=option, value=str(path),
                allowed=f"a file name that ends in {suffix}",
            )  # fmt: skip
        if not path.parent.is_dir() or path.is_dir():
            raise InputError(
                f"{option} {path} cannot be written", code="C40", field=option, value=str(path),
                allowed="a file in a folder that exists",
            )  # fmt: skip
    if step is not None and picture is None:
        raise InputError(
            f"--step is {step}, but there is no --picture", code="C41", field="--step", value=step,
            fix="add --picture FILE.png",
        )  # fmt: skip


@app.command()
def doctor(debug: Debug = False) -> None:
    """Show versions and check that three kinematics agree on this machine."""
    with guarded(debug=debug) as guard:
        from testbed.doctor import LIMIT, check_kinematics
        from testbed.screen import table
        from testbed.versions import all_versions

        say(table("", ("package", "version"), [list(item) for item in all_versions().items()]))
        found = check_kinematics()
        rows = [
            [a.robot, f"MDH = {a.other}", f"{a.position:.1e}", f"{a.rotation:.1e}",
             "good" if a.good else "BAD"]
            for a in found
        ]  # fmt: skip
        head = ("robot", "check", "largest difference m", "rad", "")
        say(table("", head, rows))
        good = all(a.good for a in found)
        say(
            "All is well."
            if good
            else f"A difference is above {LIMIT:g}: results cannot be trusted."
        )
        guard.code = 0 if good else SOME_FAILED
