"""The walls of the house: who may import whom, what stays unloaded, and how soon help answers."""

import ast
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest

from tests.fresh import printed, python

ROOT = Path(__file__).parents[1]
ALLOWED = {
    "calib": {"numpy", "scipy", "numba", "pandas", "pyarrow", "calib"},
    "testbed": {
        "numpy", "scipy", "calib", "testbed", "mujoco", "yourdfpy", "trimesh", "manifold3d",
        "lxml", "rerun", "rerun_cli", "pydantic", "typer", "rich", "matplotlib",
        "jinja2", "openpyxl", "distributed", "PIL",
    },
}  # fmt: skip
HOMES = {
    "csv": ("testbed/gates/text.py", "testbed/report/text.py"),
    "tomllib": ("testbed/gates/toml.py", "testbed/versions.py", "testbed/assets.py"),
    **dict.fromkeys(("pickle", "marshal", "shelve"), ("nowhere",)),
    "numba": ("calib/kernels/",),
    **dict.fromkeys(("pandas", "pyarrow"), ("calib/shown.py",)),
    "mujoco": ("testbed/robots/write/mjcf", "testbed/robots/describe/mjcf", "testbed/laboratory/"),
    "rerun": ("testbed/recording/", "recording", "testbed/cli/viewer.py"),
    "rerun_cli": ("testbed/cli/viewer.py",),
    "yourdfpy": ("testbed/robots/describe/urdf", "testbed/robots/write/urdf"),
    "trimesh": ("testbed/robots/meshes/",),
    "lxml": ("testbed/robots/",),
    "openpyxl": ("testbed/gates/workbook.py",),
    "distributed": ("testbed/engines/cluster.py",),
    "matplotlib": ("testbed/report/", "plots"),
    "PIL": ("testbed/cli/video.py",),
    "jinja2": ("testbed/report/page.py",),
    "rich": ("testbed/cli/terminal.py", "testbed/report/text.py"),
    "typer": ("testbed/cli/",),
    "pydantic": (
        "testbed/bounds.py",
        "testbed/strict.py",
        "testbed/gates/mistakes.py",
        "testbed/scenario/",
        "testbed/robots/",
        "testbed/files/",
        "testbed/studies/many_robots.py",
        "testbed/schemas/",
        "settings",
    ),
}
"""Where a package may be imported: a folder or file from the top, or how a file's name begins."""
FLOORS = {
    "testbed": (
        ("assets", "bounds", "disk", "faults", "machine", "names", "progress", "screen_reader",
         "streams", "strict", "toml_text", "units", "versions"),
        ("gates", "lengths"),
        ("robots", "store", "report"),
        ("scenario", "recording", "jobsheet"),
        ("laboratory", "studies/protocol"),
        ("studies/trial", "studies/many_robots", "studies/over_robots", "plan", "files", "engines"),
        ("studies/kinds", "iso9283", "schemas"),
        ("studies/pose_sets", "studies/coverage", "studies/compensation", "studies/wen2022",
         "identify", "run", "proposal"),
        ("cli", "front"),
    ),
    "calib": (
        ("errors",),
        ("arrays", "kinds", "shown"),
        ("geometry", "held_out_counts", "kernels"),
        ("measurement", "correction_words"),
        ("information", "compensation", "single_poses"),
        ("design", "identification"),
        ("uncertainty",),
        ("calibration",),
        ("front",),
    ),
}  # fmt: skip
"""Rooms from the ground up: a room imports itself and lower floors only."""
NEVER = (
    *(("testbed/run/", f"testbed.studies.{name}") for name in
      ("pose_sets", "coverage", "compensation", "wen2022", "many_robots", "over_robots")),
    *(("testbed/engines/", f"testbed.studies.{name}") for name in
      ("trial", "pose_sets", "coverage", "compensation", "wen2022", "many_robots", "over_robots")),
    ("testbed/identify/", "testbed.studies"),
    ("testbed/identify/", "testbed.laboratory.truth"),
    ("testbed/plan/", "testbed.studies"),
    ("testbed/plan/", "testbed.laboratory.truth"),
    ("testbed/files/", "testbed.laboratory.truth"),
    ("testbed/iso9283/", "testbed.studies"),
    ("testbed/iso9283/", "testbed.laboratory.truth"),
    *((f"testbed/laboratory/{name}", "testbed.laboratory.truth") for name in
      ("bench.py", "cell.py", "collisions.py", "goal.py", "joint_lists.py", "pool.py",
       "simulator.py", "route/", "tracker/")),
)  # fmt: skip
"""(who, may not import this), though it lies lower: the truth stays secret."""
HEAVY = (
    "numba",
    "pandas",
    "pyarrow",
    "mujoco",
    "rerun",
    "trimesh",
    "yourdfpy",
    "matplotlib",
    "jinja2",
    "lxml",
    "manifold3d",
    "openpyxl",
)
DOOR = "testbed/front/truebed/"
"""The one folder that imports `truebed`: it is that package."""
MOST_FLOORS, MOST_LINES, MOST_FILES = 9, 320, 25
BREACHES: set[tuple[str, str]] = set()
"""Arrows that still point the wrong way (file, module): the list may only shrink."""
CIRCLES: set[str] = set()
"""Files that still lie on a circle of imports: the list may only shrink."""


class Facts(NamedTuple):
    """What the walls ask of one file."""

    imports: tuple[str, ...]
    """Modules imported, those inside functions too."""
    classes: tuple[str, ...]
    says: str | None
    """The docstring."""
    lines: int


def statements(tree):
    """Every statement of a file, those inside others too; no expression holds an import."""
    left = [tree]
    while left:
        node = left.pop()
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            left += getattr(node, name, ())
        yield node


@cache
def facts_of(text):
    """Facts of a file with this text: each is parsed once, for all tests."""
    tree = ast.parse(text)
    imports, classes = [], []
    for node in statements(tree):
        if isinstance(node, ast.Import):
            imports += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            imports += [f"{module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ClassDef):
            classes.append(node.name)
    return Facts(tuple(imports), tuple(classes), ast.get_docstring(tree), text.count("\n"))


def facts(path):
    return facts_of(path.read_text(encoding="utf-8"))


def files(root):
    for package in ALLOWED:
        yield from sorted((root / package).rglob("*.py"))


def name_of(path, root):
    """The module in a file: ``testbed.run.play``; a package has the name of its folder."""
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(module):
    """Room of a module: what lies right under its package, and each study."""
    parts = module.split(".")
    if len(parts) == 1:
        return "front" if module == "calib" else ""
    if parts[0] == "testbed" and parts[1] == "studies":
        if len(parts) == 2 or parts[2] == "protocol":
            return "studies/protocol"
        return f"studies/{parts[2]}"
    return "cli" if parts[1] == "__main__" else parts[1]


def arrows(root):
    """(file, its module, imported module) inside the two packages, each once."""
    known = {name_of(path, root) for path in files(root)}
    for path in files(root):
        here = name_of(path, root)
        seen = set()
        for name in facts(path).imports:
            target = name if name in known else name.rpartition(".")[0]
            if target in known and target != here and target not in seen:
                seen.add(target)
                yield path.relative_to(root).as_posix(), here, target


def floor_of(module):
    """(package, floor) of a module; None where the tables do not know its room."""
    package = module.split(".")[0]
    for level, rooms in enumerate(FLOORS[package]):
        if room_of(module) in rooms:
            return package, level
    return None


def wrong_way(root):
    """(file, module) of every import that points up, sideways, or through a closed door."""
    found = set()
    for file, here, there in arrows(root):
        if there in ("calib", "testbed"):
            continue  # a package alone is its docstring or its front door
        if here.startswith("calib") and there.startswith("testbed"):
            found.add((file, there))
        elif here.split(".")[0] == there.split(".")[0] and room_of(here) not in (
            room_of(there),
            "",
        ):
            ours, theirs = floor_of(here), floor_of(there)
            if ours is None or theirs is None or theirs[1] >= ours[1]:
                found.add((file, there))
        for who, closed in NEVER:
            if file.startswith(who) and f"{there}.".startswith(f"{closed}."):
                found.add((file, there))
    return found


def on_circles(root):
    """Files from which imports lead back to themselves (Tarjan's strong components)."""
    graph, paths = {}, {}
    for file, here, there in arrows(root):
        graph.setdefault(here, set()).add(there)
        paths[here] = file
    order, low, stack, found = {}, {}, [], set()

    def visit(node):
        order[node] = low[node] = len(order)
        stack.append(node)
        for other in sorted(graph.get(node, ())):
            if other not in order:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], order[other])
        if low[node] == order[node]:
            component = []
            while not component or component[-1] != node:
                component.append(stack.pop())
            if len(component) > 1:
                found.update(paths[module] for module in component)

    for node in sorted(graph):
        if node not in order:
            visit(node)
    return found


def breaches(root):
    """Sentences, one per import of a package that the house or the room does not have."""
    found = []
    for path in files(root):
        name = path.relative_to(root).as_posix()
        for module in facts(path).imports:
            top = module.split(".")[0]
            if top == "truebed" and name.startswith(DOOR):
                continue
            if top not in sys.stdlib_module_names and top not in ALLOWED[name.split("/")[0]]:
                found.append(f"{name} may not import {top or module}")
            elif top in HOMES and not at_home(name, HOMES[top]):
                found.append(f"{top} belongs to {', '.join(HOMES[top])}, not to {name}")
    return sorted(set(found))


def at_home(name, homes):
    """Whether a file lies in one of the homes, or it or one of its folders is named like one."""
    parts = name.split("/")
    return any(
        name.startswith(home) if "/" in home else any(part.startswith(home) for part in parts)
        for home in homes
    )


def test_packages_are_imported_only_at_home():
    assert breaches(ROOT) == []


def test_no_import_points_up_but_those_that_are_listed():
    assert wrong_way(ROOT) == BREACHES


def test_no_imports_go_in_a_circle_but_those_that_are_listed():
    assert on_circles(ROOT) == CIRCLES


def test_every_room_has_its_floor_and_there_are_at_most_nine():
    rooms = {room_of(name_of(path, ROOT)) for path in files(ROOT)} - {""}
    assert rooms <= {room for floors in FLOORS.values() for floor in floors for room in floor}
    assert all(len(floors) <= MOST_FLOORS for floors in FLOORS.values())


GOOD = {
    "calib/geometry/chain.py": "import numpy as np\nfrom calib.arrays import Array\n",
    "calib/arrays.py": "import math\nfrom calib.errors import InputError\n",
    "calib/errors.py": "",
    "testbed/laboratory/simulator.py": "from calib.geometry.chain import Chain\nimport mujoco\n",
    "testbed/identify/recording_story.py": "def write():\n    import rerun\n",
}


def tree(root, texts):
    for name, text in texts.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return root


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("calib/geometry/bad.py", "import mujoco\n", "calib/geometry/bad.py may not import mujoco"),
        (
            "calib/geometry/bad.py",
            "from testbed import cli\n",
            "calib/geometry/bad.py may not import testbed",
        ),
        (
            "calib/geometry/bad.py",
            "def f():\n    from matplotlib import pyplot\n",
            "calib/geometry/bad.py may not import matplotlib",
        ),
        (
            "testbed/cli/app.py",
            "import rerun.blueprint\n",
            "rerun belongs to testbed/recording/, recording, testbed/cli/viewer.py, "
            "not to testbed/cli/app.py",
        ),
        (
            "calib/uncertainty/bad.py",
            "def f():\n    import numba\n",
            "numba belongs to calib/kernels/, not to calib/uncertainty/bad.py",
        ),
        ("testbed/bad.py", "import models\n", "testbed/bad.py may not import models"),
        ("testbed/bad.py", "from tests import reference\n", "testbed/bad.py may not import tests"),
        ("testbed/bad.py", "from .tracker import T\n", "testbed/bad.py may not import .tracker.T"),
    ],
)
def test_each_foreign_package_is_named(tmp_path, name, text, message):
    assert breaches(tree(tmp_path, GOOD)) == []
    assert breaches(tree(tmp_path, {name: text})) == [message]


@pytest.mark.parametrize(
    ("files_of_a_house", "wrong"),
    [
        ({"calib/design/greedy.py": "", "calib/geometry/bad.py": "import calib.design.greedy"}, 1),
        ({"calib/design/bad.py": "def f():\n  from calib.identification import prior",
          "calib/identification/prior.py": ""}, 1),
        ({"testbed/store/npz.py": "",
          "testbed/report/bad.py": "from testbed.store.npz import x"}, 1),
        ({"testbed/units.py": "", "testbed/disk.py": "from testbed.units import MM"}, 1),
        ({"testbed/laboratory/truth/robot.py": "",
          "testbed/plan/bad.py": "from testbed.laboratory.truth.robot import draw"}, 1),
        ({"testbed/studies/trial/play.py": "", "testbed/studies/coverage/play.py": "",
          "testbed/run/play.py": "import testbed.studies.trial.play\n"
                                 "import testbed.studies.coverage.play"}, 1),
        ({"testbed/attic/old.py": "", "testbed/run/play.py": "import testbed.attic.old"}, 1),
        ({"testbed/store/npz.py": "", "testbed/run/play.py": "from testbed.store import npz"}, 0),
    ],
)  # fmt: skip
def test_each_wrong_arrow_is_found(tmp_path, files_of_a_house, wrong):
    assert len(wrong_way(tree(tmp_path, files_of_a_house))) == wrong


def test_a_circle_is_found_across_functions(tmp_path):
    texts = {
        "testbed/run/a.py": "from testbed.run import b",
        "testbed/run/b.py": "def f():\n    from testbed.run.c import x",
        "testbed/run/c.py": "from testbed.run.a import y\nfrom testbed.run.d import z",
        "testbed/run/d.py": "",
    }
    assert on_circles(tree(tmp_path, texts)) == {f"testbed/run/{name}.py" for name in "abc"}


@cache
def loaded_by(statement):
    """Modules that one statement loads in a fresh interpreter."""
    return set(printed(f"import sys; {statement}; print(*sys.modules)"))


@cache
def loaded_in_turn():
    """Modules loaded after each of some statements in one interpreter, each needing more."""
    scenes = ", ".join(f"'{path.stem}'" for path in (ROOT / "scenes").glob("*.toml"))
    statements = (
        "import calib, testbed, truebed",
        "calib.Chain; calib.RobotModel; calib.points; calib.poses",
        f"from testbed import studies; [*map(studies.load_scenario, [{scenes}])]",
        f"import {', '.join(ROOMS)}; testbed.robots.catalog.load_robot('staubli_tx60')",
    )
    told = [f"{one}\nprint(*sys.modules)\n" for one in statements]
    lines = python("-c", "import sys\n" + "".join(told)).stdout.splitlines()
    return [set(line.split()) for line in lines]


ROOMS = (
    "calib", "calib.uncertainty.bootstrap", "testbed.scenario.read", "testbed.run.play",
    "testbed.studies.trial.study", "testbed.run.derive", "testbed.cli.viewer",
    "testbed.robots.catalog", "testbed.robots.write.mjcf", "testbed.robots.write.urdf",
    "testbed.robots.meshes.solids", "testbed.laboratory.pool", "testbed.files.read",
    "testbed.laboratory.truth.robot", "testbed.laboratory.tracker.tracker",
)  # fmt: skip


def test_what_is_not_needed_yet_stays_unloaded():
    """One process for all: what any of them loads, all load."""
    *_, loaded = loaded_in_turn()
    assert set(ROOMS) <= loaded
    assert not loaded & {*HEAVY, "scipy.stats"}


def test_importing_a_package_loads_nothing_else():
    loaded, *_ = loaded_in_turn()
    assert "truebed" in loaded
    assert not {m.split(".")[0] for m in loaded} & {"numpy", "pydantic"}


def test_the_types_that_pass_the_door_load_no_scipy():
    loaded = loaded_in_turn()[1]
    assert "numpy" in loaded
    assert "scipy" not in loaded


def test_reading_every_shipped_scene_and_robot_loads_no_scipy():
    """It takes as long as all else that `truebed scenes` does."""
    loaded = loaded_in_turn()[2]
    assert "pydantic" in loaded
    assert "scipy" not in loaded


def test_a_name_at_the_door_is_not_that_of_a_module_beside_it():
    """The module would take the place of the function once it is imported."""
    import calib

    names = set(dir(calib))
    modules = {path.stem for path in (ROOT / "calib").iterdir()}
    rooms = {name for name in names if isinstance(getattr(calib, name), ModuleType)}
    assert names & modules <= rooms


def test_help_loads_nothing_but_typer_and_the_verbs():
    """Modules of typer and of the command itself, and the errors that it ends with."""
    more = loaded_by("import testbed.cli") - loaded_by("import typer")
    assert {name for name in more if not name.startswith("testbed.cli")} == {
        "calib",
        "calib.errors",
        "mmap",  # of Python itself, to ask for room
        "testbed",
        "testbed.machine",
        "testbed.screen_reader",
    }


def test_the_command_sets_its_environment_before_numpy_is_imported():
    code = (
        "import sys, os, testbed.__main__ as m; assert 'numpy' not in sys.modules; "
        "sys.argv = ['truebed', '--version']\n"
        "try:\n    m.main()\nexcept SystemExit:\n    pass\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['MUJOCO_GL'])"
    )
    assert printed(code)[-2:] == ["1", "disable"]


def test_each_module_says_first_what_lives_there_and_stays_small():
    for path in files(ROOT):
        assert facts(path).says or not path.stat().st_size, path
        assert facts(path).lines <= MOST_LINES, f"{path} has more than one subject"


def test_the_front_is_installed_from_a_folder_that_is_no_package():
    """Its prefix is removed: an `__init__` there would lie at the top of site-packages."""
    assert not (ROOT / "testbed" / "front" / "__init__.py").exists()
    for package in ("calib", "testbed", "testbed/front/truebed"):
        assert (ROOT / package / "py.typed").exists()


def test_no_folder_is_a_street_sorted_by_first_name():
    for package in (*ALLOWED, "tests"):
        folders = {path.parent for path in (ROOT / package).rglob("*.py")}
        for folder in folders:
            assert len(list(folder.glob("*.py"))) <= MOST_FILES, folder


def test_one_class_name_has_one_meaning():
    homes: dict[str, list[str]] = {}
    for path in files(ROOT):
        for name in facts(path).classes:
            homes.setdefault(name, []).append(path.relative_to(ROOT).as_posix())
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}
