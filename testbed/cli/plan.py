"""The verb that comes before measurements: plan chooses poses for a real robot."""

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.app import Debug, Json, Plain, Quiet, app
from testbed.cli.campaign import Scene, Seed, default_folder, scenario_of, warn_of
from testbed.cli.exit_codes import SOME_FAILED, exit_codes
from testbed.cli.output import say, say_found, say_json, say_next
from testbed.machine import COMPUTING


@app.command()
def plan(
    scene: Scene,
    out: Annotated[Path | None, typer.Option(help="Output folder [runs/SCENE-seedN-plan].")] = None,
    seed: Seed = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="First rename an old plan of that name.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
    plain: Plain = False,
    debug: Debug = False,
) -> None:
    """Plan a real measurement: which poses, in which order, how good.

    What will come out is predicted before anything is measured.
    """
    with exit_codes(debug=debug, plain=plain, as_json=as_json, room=COMPUTING) as end:
        scenario, where = scenario_of(scene, seed)
        default = default_folder(scenario)
        folder = out or default.with_name(f"{default.name}-plan")
        warn_of(scenario, where, quiet=quiet or as_json)
        from testbed.cli.terminal import progress
        from testbed.plan.folder import RECORDING, REPORT, TABLE, play_plan
        from testbed.plan.words import terminal_text
        from testbed.store.layout import PLAN

        with progress(f"plan {scenario.name}", quiet=quiet or as_json) as tell:
            made = play_plan(scenario, folder, overwrite=overwrite, progress=tell, where=where)
        end.code = SOME_FAILED if made.tour.blocked else end.code
        if as_json:
            say_json((folder / PLAN).read_text(encoding="utf-8").rstrip())
        elif not quiet:
            say_found(terminal_text(made))
            say()
            say(f"Poses      {folder / TABLE}")
            say(f"Report     {folder / REPORT}")
            say_next("truebed", "view", folder / RECORDING)
