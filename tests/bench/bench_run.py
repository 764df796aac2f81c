"""Whole runs of the command, as a user types them: wall time and memory from a fresh process."""

import json
import subprocess
import sys

import pytest


@pytest.mark.benchmark(group="truebed run")
@pytest.mark.parametrize("scene", ["quick", "wen2022"])
def test_run(benchmark, tmp_path, scene):
    numbers = iter(range(100))
    folder = None

    def run():
        nonlocal folder
        folder = tmp_path / str(next(numbers))
        command = [sys.executable, "-m", "testbed", "run", scene, "--out", str(folder), "--quiet"]
        subprocess.run(command, check=True)

    benchmark.pedantic(run, rounds=3, warmup_rounds=1)
    timing = json.loads((folder / "timing.json").read_text(encoding="utf-8"))
    benchmark.extra_info["peak_memory_mb"] = max(timing["peak_memory_mb"].values())
    benchmark.extra_info["wall_s"] = timing["wall_s"]


@pytest.mark.benchmark(group="truebed --help")
def test_help(benchmark):
    command = [sys.executable, "-m", "testbed", "--help"]
    benchmark.pedantic(lambda: subprocess.run(command, check=True, capture_output=True), rounds=5)
