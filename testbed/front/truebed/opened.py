"""Reading back what this program wrote: folders of every kind, and files of single results."""

from pathlib import Path
from typing import Any

from calib.errors import refuse
from testbed.files.read import read_session
from testbed.files.session_toml import SESSION_FILE
from testbed.gates.paths import is_there, near
from testbed.gates.toml import read_toml_bytes, toml_document
from testbed.identify.folder import load_calibration
from testbed.robots.catalog import ROBOT_FILE, load_robot
from testbed.run.play import load_run
from testbed.store.manifest import CALIBRATION, kind_of, read_manifest
from testbed.store.written import written_folder
from truebed.saved import SUFFIX, WANTED, kept


def opened(path: Path) -> Any:
    """Read a folder or a file, as `truebed.load` does.

    Raises
    ------
    InputError
        D42: there is nothing that this program wrote.
    """
    if path.suffix == SUFFIX and is_there(path, Path.is_file):
        return kept(path)
    if not is_there(path, Path.is_dir):
        message = "is a file" if is_there(path) else "does not exist"
        fix = WANTED if is_there(path) else near(path, WANTED)
        raise refuse("", code="D42", message=message, fix=fix, where=str(path))
    if (written := written_folder(path)) is not None:
        return written
    if (path / ROBOT_FILE).is_file():
        return load_robot(path)
    if (file := path / SESSION_FILE).is_file():
        document = toml_document(read_toml_bytes(file, str(file)), str(file))
        return read_session(file, load_robot(str(document.get("robot", ""))))
    if kind_of(read_manifest(path)) == CALIBRATION:
        return load_calibration(path)[0]
    return load_run(path)
