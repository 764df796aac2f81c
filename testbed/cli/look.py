"""The verbs that look: scenes, robots, compare, report, record, view and doctor."""

from pathlib import Path
from typing import Annotated

import typer

from calib.errors import refuse
from testbed.cli.app import Debug, Json, Plain, Run, app, robots_like, scenes_like
from testbed.cli.exit_codes import SOME_FAILED, exit_codes
from testbed.cli.output import say, say_found, say_json, warn

Trial = Annotated[str | None, typer.Option(metavar="NAME", help="Trial to show [the first].")]


@app.command()
def scenes(
    name: Annotated[
        str | None, typer.Argument(help="Show this one in full.", autocompletion=scenes_like)
    ] = None,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """List the shipped scenes, or show one with all its defaults."""
    with exit_codes(debug=debug, plain=plain):
        if name is not None:
            say(scene_in_full(name).rstrip())
            return
        from testbed.assets import scene_rows
        from testbed.cli.timings import lasts
        from testbed.names import some
        from testbed.report.text import table

        rows = []
        for known, robot, title, trials in scene_rows():
            verb = "plan" if known.startswith("plan") else "run"
            rows.append([known, lasts(f"{verb} {known}"), robot, title, some(trials, 4)])
        say(table("", ("scene", "takes about", "robot", "what", "trials"), rows, wrap=True))
        say("\nPlay one: truebed run SCENE")


def scene_in_full(name: str) -> str:
    """A scene with every default, its author's comments, and the schema that an editor looks for.

    The line that names the schema is the first, or editors do not see it.
    """
    from testbed.gates.comments import with_comments
    from testbed.gates.toml import read_toml_bytes
    from testbed.scenario.read import dump_scenario, scenario_path
    from testbed.schemas.names import directive, schema_name
    from testbed.studies import load_scenario

    whole = dump_scenario(load_scenario(name))
    source = read_toml_bytes(*scenario_path(name)).decode("utf-8-sig")
    how = f"# Write it beside this file: truebed schema scene > {schema_name('scene')}\n"
    return directive("scene") + how + with_comments(whole, source)


@app.command()
def robots(
    name: Annotated[
        str | None, typer.Argument(help="Show this one in full.", autocompletion=robots_like)
    ] = None,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """List the shipped robots, or show one."""
    with exit_codes(debug=debug, plain=plain):
        if name is not None:
            from testbed.cli.terminal import robot_text
            from testbed.robots.catalog import load_robot

            say_found(robot_text(load_robot(name)))
            return
        from testbed.assets import robot_rows
        from testbed.report.text import table

        say(table("", ("robot", "title", "joints", "folder"), robot_rows()))


@app.command()
def compare(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN RUN...", help="Folders, or one that contains them.")
    ],
    as_json: Json = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Compare runs, plans, calibrations or tests in tables.

    Runs that are identical byte for byte are listed.
    """
    with exit_codes(debug=debug, plain=plain, as_json=as_json):
        from testbed.cli import compared
        from testbed.cli.folders import by_kind
        from testbed.run.result import equal_runs, read_result
        from testbed.store.manifest import CAMPAIGN

        found = {
            path: (kind, read_result(path) if kind == CAMPAIGN else compared.document(kind, path))
            for kind, paths in by_kind(runs).items()
            for path in paths
        }
        played = [path for path, (kind, _) in found.items() if kind == CAMPAIGN]
        equal = equal_runs(played)
        if as_json:
            import json

            document = {str(path): result for path, (_, result) in found.items()}
            groups = [[str(path) for path in group] for group in equal]
            say_json(json.dumps({"runs": document, "equal_bytes": groups}, ensure_ascii=False))
            return
        for kind in dict.fromkeys(kind for kind, _ in found.values()):
            alike = {str(path): result for path, (its, result) in found.items() if its == kind}
            say_found(compared.table_of(kind, alike))
        for group in equal:
            say(f"Equal byte for byte: {', '.join(str(path) for path in group)}")
        if len(played) > 1 and not equal:
            say("No two of these runs are equal.")


@app.command()
def report(
    folder: Run,
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Print it to report.pdf, by a browser that is installed.")
    ] = False,
    embed: Annotated[
        bool, typer.Option("--embed", help="Write it with the recording in it as well, to play.")
    ] = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Write report.html, result.json and arrays.npz again.

    They are made from the records; nothing is recomputed.
    """
    with exit_codes(debug=debug, plain=plain) as end:
        from testbed.cli import handout
        from testbed.cli.folders import AGAIN, PRINTED, report_in, require
        from testbed.run.play import recording_of
        from testbed.store.layout import ARRAYS, REPORT, RESULT

        found = require(folder, (*AGAIN, *PRINTED) if pdf and not embed else AGAIN)
        printer = handout.require_browser() if pdf else ""
        if found in PRINTED:  # as it was written: no records of it are kept
            say(str(handout.print_pdf(report_in(folder, found), printer)))
            return
        end.folder = folder
        derive_again(folder, (RESULT, ARRAYS, REPORT))
        page = folder / REPORT
        say(str(page))
        if pdf:
            say(str(handout.print_pdf(page, printer)))
        if embed:
            say(str(handout.with_recording(page, recording_of(folder, None))))


@app.command()
def record(folder: Run, trial: Trial = None, plain: Plain = False, debug: Debug = False) -> None:
    """Write the recording again, or that of another trial."""
    with exit_codes(debug=debug, plain=plain) as end:
        from testbed.cli.folders import AGAIN, ISO9283, refuse_trial, require
        from testbed.run.play import record_trial
        from testbed.store.layout import RECORDING

        found = require(folder, (*AGAIN, ISO9283))
        end.folder = folder
        if found == ISO9283:
            from testbed.iso9283.folder import record_again

            refuse_trial(folder, trial, found)
            say(str(record_again(folder)))
        elif trial is None:
            derive_again(folder, (RECORDING,))
            say(str(folder / RECORDING))
        else:
            say(str(record_trial(folder, trial)))


def derive_again(folder: Path, names: tuple[str, ...]) -> None:
    """Write derived files again, of a campaign or of a calibration."""
    from testbed.store.manifest import CALIBRATION, kind_of, read_manifest

    if kind_of(read_manifest(folder)) == CALIBRATION:
        from testbed.identify.folder import rederive_calibration

        rederive_calibration(folder, names)
        return
    from testbed.run.play import rederive

    rederive(folder, names)


@app.command()
def view(
    folder: Run,
    trial: Trial = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Make a picture; no window opens.")
    ] = None,
    step: Annotated[
        int | None, typer.Option(help="Step to show in the picture, from 0 [the last].")
    ] = None,
    html: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Make a web page that plays it.")
    ] = None,
    video: Annotated[
        Path | None,
        typer.Option(metavar="FILE.mp4|gif", help="Make a film; takes a minute or two."),
    ] = None,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Open the recording of a run, or make a picture or film of it."""
    with exit_codes(debug=debug, plain=plain):
        from testbed.cli import video as video_file
        from testbed.cli import viewer
        from testbed.cli.folders import recording_in

        file = recording_in(folder, trial)
        check_view(picture, html, step, video)
        if video is not None and video.suffix != ".gif":
            video_file.require_encoder(video)
        if picture is not None:
            viewer.picture(file, picture, step=step, tell=warn)
            say(str(picture))
        if html is not None:
            viewer.html_page(file, html)
            say(str(html))
        if video is not None:
            video_file.film(file, video)
            say(str(video))
        if picture is None and html is None and video is None:
            viewer.open_viewer(file, warn)


def check_view(
    picture: Path | None, html: Path | None, step: int | None, video: Path | None = None
) -> None:
    """Refuse a picture, page or film that cannot be written, before a viewer is started."""
    for option, path, suffixes in (
        ("--picture", picture, (".png",)),
        ("--html", html, (".html",)),
        ("--video", video, (".mp4", ".gif")),
    ):
        if path is None:
            continue
        if path.suffix not in suffixes:
            allowed = f"a file name that ends in {' or '.join(suffixes)}"
            raise refuse(option, str(path), allowed, code="C41")
        if not path.parent.is_dir() or path.is_dir():
            message = f"{option} {path} cannot be written"
            allowed = "a file in a folder that exists"
            raise refuse(option, str(path), allowed, code="C40", message=message)
    if step is not None and picture is None:
        message, fix = f"--step is {step}, but there is no --picture", "add --picture FILE.png"
        raise refuse("--step", step, code="C41", message=message, fix=fix)


@app.command()
def doctor(plain: Plain = False, debug: Debug = False) -> None:
    """Show versions; check that three kinematics agree here."""
    with exit_codes(debug=debug, plain=plain) as end:
        from testbed.cli.doctor import LIMIT, check_kinematics
        from testbed.report.text import table
        from testbed.versions import all_versions

        say(table("", ("package", "version"), [list(item) for item in all_versions().items()]))
        found = check_kinematics()
        rows = [
            [a.robot, f"MDH = {a.other}", f"{a.position:.1e}", f"{a.rotation:.1e}",
             "good" if a.good else "BAD"]
            for a in found
        ]  # fmt: skip
        say(table("", ("robot", "check", "largest difference m", "rad", ""), rows))
        if all(a.good for a in found):
            say("All is well.")
        else:
            say(f"A difference is above {LIMIT:g}: results cannot be trusted.")
            end.code = SOME_FAILED
