"""Verbs that play a campaign: run, whole or a slice of it, and merge, which joins slices."""

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from calib.errors import InputError, refuse
from testbed.cli.app import Debug, Json, Plain, Quiet, app, scenes_like
from testbed.cli.exit_codes import MACHINE, SOME_FAILED, exit_codes
from testbed.cli.output import say, say_found, say_json, say_next, warn
from testbed.machine import COMPUTING

if TYPE_CHECKING:
    from testbed.engines.engine import Engine
    from testbed.scenario.scenario import Scenario

Scene = Annotated[
    str,
    typer.Argument(
        metavar="SCENE", help="A scene's name or a .toml file.", autocompletion=scenes_like
    ),
]
Seed = Annotated[int | None, typer.Option(help="Use another seed.")]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="First rename an old run of that name.")
]
Workers = Annotated[str, typer.Option(metavar="N", help="Number of processes; auto: one per core.")]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Dask scheduler to use: tcp://HOST:PORT or file:PATH."),
]


@app.command()
def run(
    scene: Scene,
    out: Annotated[Path | None, typer.Option(help="Output folder [runs/SCENE-seedN].")] = None,
    seed: Seed = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue a stopped run.")] = False,
    overwrite: Overwrite = False,
    export: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Also write the measurements as files for identify."),
    ] = None,
    workers: Workers = "1",
    scheduler: Scheduler = None,
    part: Annotated[
        str | None,
        typer.Option("--slice", metavar="I/N", help="Play only the I-th of N slices of robots."),
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Play a whole virtual campaign and write its run folder."""
    with exit_codes(debug=debug, plain=plain, as_json=as_json, room=COMPUTING) as end:
        scenario, where = scenario_of(scene, seed)
        folder = out or default_folder(scenario)
        end.folder = folder
        warn_of(scenario, where, quiet=quiet or as_json)
        words = ["truebed", "run", scene, "--out", str(folder)]
        words += [] if seed is None else ["--seed", str(seed)]
        if export is not None:
            require_export(export, folder, overwrite=overwrite)
            words += ["--export", str(export)]
        engine, more = engine_asked(workers, scheduler, quiet=quiet or as_json)
        words += more
        from testbed.cli.terminal import progress

        if part is not None:
            from testbed.engines.choice import slice_of
            from testbed.run.slices import play_slice

            number, count = slice_of(part)
            alone(overwrite=overwrite, export=export)
            end.resume = [*words, "--slice", part]
            with progress(quiet=quiet or as_json) as report, closing(engine):
                played = play_slice(
                    scenario, folder, number, count, progress=report, where=where, engine=engine
                )
            end.code = MACHINE if played.failed else end.code  # an array job is not done with it
            if not (quiet or as_json):
                for name, reason in played.failed.items():
                    say(f"FAILED {name}: {reason}")
                say(f"Slice {part}   {played.pieces} pieces in {folder / 'parts'}")
                say_next(*words, "--resume", when="when all slices have ended: ")
                merging = "truebed merge FOLDER FOLDER... --out DIR"
                say(f"Or         of slices in folders of their own: {merging}")
            return
        end.resume = [*words, "--resume"]
        from testbed.engines.choice import cores, workers_of
        from testbed.run.play import planned_steps, play_run, robot_of

        # how many processes a scheduler has nobody knows
        work = "" if scheduler is not None else f"run {scenario.name}"
        shown = progress(
            work,
            planned_steps(scenario),
            quiet=quiet or as_json,
            workers=min(workers_of(workers), cores()),
            learn=not resume,
        )
        with shown as report, closing(engine):
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
            from testbed.files.session_toml import SESSION_FILE
            from testbed.run.export import export_campaign

            arm = robot_of(scenario, where)
            export_campaign(outcome.campaign, arm, export, overwrite=overwrite)
        tell(folder, quiet=quiet, as_json=as_json, exported=export and export / SESSION_FILE)


@app.command()
def merge(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN RUN...", help="Folders with slices of one run.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the whole run.")],
    overwrite: Overwrite = False,
    workers: Workers = "1",
    scheduler: Scheduler = None,
    quiet: Quiet = False,
    as_json: Json = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Join slices of a run from several folders. Missing parts are played."""
    with exit_codes(debug=debug, plain=plain, as_json=as_json, room=COMPUTING) as end:
        end.folder = out
        engine, more = engine_asked(workers, scheduler, quiet=quiet or as_json)
        end.resume = ["truebed", "run", str(out), "--out", str(out), *more, "--resume"]
        from testbed.cli.terminal import progress
        from testbed.run.slices import merge_runs

        with progress(quiet=quiet or as_json) as report, closing(engine):
            outcome = merge_runs(runs, out, overwrite=overwrite, progress=report, engine=engine)
        end.code = SOME_FAILED if outcome.failed else end.code
        tell(out, quiet=quiet, as_json=as_json)


def require_export(export: Path, folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder for the measurements that cannot be written, before anything is computed.

    Raises
    ------
    InputError
        C40: it is that of the run, or what `check_free` says.
    """
    from testbed.files.session_toml import SESSION_FILE
    from testbed.gates.paths import real
    from testbed.store.whole_folder import check_free

    places = [real(path, field="--export", code="C40") for path in (export, folder)]
    if places[0] == places[1]:
        fix = "choose another --export"
        raise refuse("--export", code="C40", message=f"--export {export} is --out, too", fix=fix)
    try:
        check_free(export, SESSION_FILE, overwrite=overwrite)
    except InputError as error:
        fix = error.fix.replace("--out", "--export")
        raise refuse(
            "--export", error.value, error.allowed, code=error.code, message=error.message,
            fix=fix, where=error.where,
        ) from error  # fmt: skip


def tell(folder: Path, *, quiet: bool, as_json: bool, exported: Path | None = None) -> None:
    """Print what a run gave."""
    from testbed.cli.terminal import headline
    from testbed.run.result import read_result

    if as_json:
        say_json((folder / "result.json").read_text(encoding="utf-8").rstrip())
    elif not quiet:
        result = read_result(folder)
        say_found(headline(result), good=result["verdict"].get("believable"))
        say()
        say(f"Report     {folder / 'report.html'}")
        if exported is not None:
            say(f"Exported   {exported}")
        say_next("truebed", "view", folder)


def scenario_of(scene: str, seed: int | None) -> "tuple[Scenario, str]":
    """A scene with another seed, if there is one, and what to call it in messages."""
    from testbed.scenario.read import changed, scenario_path
    from testbed.studies import load_scenario

    where = scenario_path(scene)[1]
    scenario = load_scenario(scene)
    if seed is not None:
        scenario = changed(scenario, {"seed": seed}, where="--seed")
    return scenario, where


def warn_of(scenario: "Scenario", where: str, *, quiet: bool) -> None:
    """Say on stderr what is hardly meant in a scenario."""
    from testbed.scenario.checks import odd_settings

    for text in () if quiet else odd_settings(scenario):
        warn(f"warning: {where}: {text}")


def default_folder(scenario: "Scenario") -> Path:
    """Where a run goes unless --out says otherwise."""
    return Path("runs") / f"{scenario.name}-seed{scenario.seed}"


def engine_asked(workers: str, scheduler: str | None, *, quiet: bool) -> "tuple[Engine, list[str]]":
    """Who plays pieces, and the words that ask for it; more processes than cores are said."""
    from testbed.engines.choice import crowded, engine_of, workers_of

    number = workers_of(workers)
    if not quiet and (told := crowded(number)):
        warn(told)
    words = [] if number == 1 else ["--workers", workers]
    words += [] if scheduler is None else ["--scheduler", scheduler]
    return engine_of(number, scheduler), words


def alone(*, overwrite: bool, export: Path | None) -> None:
    """Refuse what a slice cannot do: it is one of several, and no whole run."""
    given = "--overwrite" if overwrite else "--export" if export is not None else ""
    if given:
        raise refuse(
            given, None, code="C41", message=f"{given} is given with --slice",
            allowed="a slice is one of several that may share a folder",
            fix=f"give {given} with the run that joins them, or leave it out",
        )  # fmt: skip
