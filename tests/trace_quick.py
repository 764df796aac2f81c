"""Which product files are entered while the scene `quick` is read and played, stage by stage.

``python -m tests.trace_quick`` prints a table; with names of stages it lists their files; with
``--json`` it prints the files of all stages; with ``--records`` it stops before the derived files.
What an earlier stage has imported is not imported again.

A file is *called* in a stage if one of its functions was entered, *imported* if its module was
executed (what runs while a module is imported is no call), and *entered* if it was either.
"""

import json
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = tuple(str(ROOT / name) for name in ("calib", "testbed"))
READ = "read"
FEW = {"pool.size": 80, "test.poses": 20, "uncertainty.repeats": 2, "uncertainty.replications": 4}


class Tracer:
    """Files of `calib` and `testbed` entered in each stage; install with `sys.settrace`."""

    def __init__(self):
        self.called, self.imported = {}, {}
        self._here = None
        self._importing = 0
        self._files = {}

    def begin(self, stage):
        """What is entered from now on belongs to `stage`."""
        self._here = self.called.setdefault(stage, set()), self.imported.setdefault(stage, set())

    def __call__(self, frame, _event, _arg):
        code = frame.f_code
        if code not in self._files:
            name = code.co_filename
            ours = name.startswith(PACKAGES)
            self._files[code] = str(Path(name).relative_to(ROOT)) if ours else None
        file = self._files[code]
        if file is None:
            return None
        called, imported = self._here
        if code.co_name == "<module>":
            imported.add(file)
            self._importing += 1
            frame.f_trace_lines = False
            return self._imported
        if not self._importing:
            called.add(file)
        return None

    def _imported(self, _frame, event, _arg):
        if event == "return":  # of the module's code; an exception ends with one, too
            self._importing -= 1
        return self._imported


class Enough(BaseException):
    """The stages that were wanted are over."""


def traced(scene="quick", *, records_only=False):
    """(called, imported): sets of files by stage, in the order of the stages.

    Of the records alone with few poses and replications: the same files make many.
    """
    from testbed.run.play import play_run
    from testbed.scenario.read import changed
    from testbed.store.layout import DERIVED
    from testbed.studies import load_scenario

    tracer = Tracer()

    def begin(stage, *_):
        if records_only and stage in DERIVED:
            raise Enough
        tracer.begin(stage or "end")

    begin(READ)
    sys.settrace(tracer)
    try:
        scenario = load_scenario(scene)
        scenario = changed(scenario, FEW) if records_only else scenario
        begin("begin")
        with tempfile.TemporaryDirectory() as folder, suppress(Enough):
            play_run(scenario, Path(folder) / "run", progress=begin)
    finally:
        sys.settrace(None)
    return tracer.called, tracer.imported


def main(words):
    """Print the table, the files of some stages, or all of it as JSON."""
    called, imported = traced(records_only="--records" in words)
    stages = [word for word in words if not word.startswith("--")]
    if "--json" in words:
        files = {
            stage: {"called": sorted(called[stage]), "imported": sorted(imported[stage])}
            for stage in called
        }
        lines = [json.dumps(files)]
    elif stages:
        lines = []
        for stage in stages:
            lines += [f"{stage}: called", *(f"  {file}" for file in sorted(called[stage]))]
            lines += [f"{stage}: imported", *(f"  {file}" for file in sorted(imported[stage]))]
    else:
        lines = [f"{'stage':24}{'called':>8}{'imported':>10}{'entered':>9}"]
        for stage, files in called.items():
            entered = files | imported[stage]
            lines.append(f"{stage:24}{len(files):8}{len(imported[stage]):10}{len(entered):9}")
    print("\n".join(lines))  # noqa: T201 - a script


if __name__ == "__main__":
    main(sys.argv[1:])
