"""The folder of a test: everything computed first, then written whole or not at all."""

from pathlib import Path

from calib.errors import refuse
from testbed.disk import atomic_write
from testbed.gates.paths import real
from testbed.iso9283.play import play_test
from testbed.iso9283.records import CycleResult, CycleTest
from testbed.iso9283.report import page_of, sheet_rows
from testbed.iso9283.results import FILES, headline, iso_csv
from testbed.iso9283.shown import RECORD, ShownTest, shown_test, spec_of
from testbed.jobsheet.report import JOB_SHEET, job_csv
from testbed.report.page import render
from testbed.store.documents import damaged, read_json
from testbed.store.layout import ISO9283, PLAYED_TEST, REPORT, RESULT, TEST
from testbed.store.npz import DamagedError, Failure, pretty_json, record_bytes, record_from
from testbed.store.whole_folder import check_free, whole_folder
from testbed.versions import all_versions, own_version

AGAIN = "give the `truebed iso9283` command again with another --out"


def play_iso9283(test: CycleTest, out: Path, *, overwrite: bool = False) -> CycleResult:
    """All figures of a test, and the folder that tells them.

    Parameters
    ----------
    test : CycleTest
        As `testbed.iso9283.read.read_test` gives it.
    out : Path
        Folder to write; it must not be there, unless `overwrite` renames an older one.
    overwrite : bool
        Rename an older folder of a test there first.
    """
    check_place(out, overwrite=overwrite)
    result = play_test(test)
    with whole_folder(out, ISO9283, overwrite=overwrite) as folder:
        page = render(page_of(result, all_versions()))
        (folder / REPORT).write_bytes(page.encode())
        document = {**headline(result), "truebed": own_version()}
        (folder / RESULT).write_bytes(pretty_json(document))
        shown = shown_test(result)
        (folder / TEST).write_bytes(record_bytes(RECORD, shown, spec_of(document[FILES])))
        (folder / PLAYED_TEST).write_bytes(_recording(shown))
        if rows := sheet_rows(result):
            (folder / JOB_SHEET).write_bytes(job_csv(rows).encode())
        (folder / ISO9283).write_bytes(iso_csv(result).encode())
    return result


def record_again(folder: Path) -> Path:
    """Write the recording of a test again from its record; its path.

    Raises
    ------
    InputError
        The record is missing, damaged, or of other files than the result.
    """
    file = folder / TEST
    document = read_json(folder / RESULT, fix=AGAIN)
    try:
        shown = record_from(file.read_bytes(), RECORD, ShownTest, spec_of(document.get(FILES, {})))
    except OSError as error:
        message = "cannot be read, and older versions wrote none"
        raise refuse("", code="D42", message=message, fix=AGAIN, where=str(file)) from error
    except DamagedError as error:
        raise damaged(file, str(error), AGAIN) from error
    if isinstance(shown, Failure):
        raise damaged(file, "holds no test", AGAIN)
    atomic_write(folder / PLAYED_TEST, _recording(shown))
    return folder / PLAYED_TEST


def _recording(shown: ShownTest) -> bytes:
    """The recording's file."""
    from testbed.iso9283.recording import test_story
    from testbed.recording.write import story_bytes

    return story_bytes(test_story(shown))


def check_place(out: Path, *, overwrite: bool) -> None:
    """Refuse a folder that cannot be written, before anything is read or computed; C40."""
    real(out, field="--out", code="C40")
    check_free(out, ISO9283, overwrite=overwrite)


def terminal_text(result: CycleResult) -> str:
    """What the command prints: notice, figures, verdict, reasons."""
    from testbed.iso9283.report import headline as headline_table
    from testbed.iso9283.words import mark, notice, reasons, verdict
    from testbed.report.text import table, verdict_lines
    from testbed.units import plain

    shown = headline_table(result)
    rows = [[plain(cell).replace("–", "-") for cell in row] for row in shown.rows]
    parts = [notice(result), table(shown.caption, shown.head, rows), ""]
    parts += verdict_lines(f"{plain(mark(result))[2:]}. {plain(verdict(result))}")
    parts += [f"  {plain(reason)}" for reason in reasons(result)]
    return "\n".join(parts)
