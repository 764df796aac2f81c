"""The folder of a test: everything computed first, then written whole or not at all."""

from pathlib import Path

from testbed.gates.paths import real
from testbed.iso9283.play import play_test
from testbed.iso9283.records import CycleResult, CycleTest
from testbed.iso9283.report import page_of, sheet_rows
from testbed.iso9283.results import headline, iso_csv
from testbed.jobsheet.report import JOB_SHEET, job_csv
from testbed.report.page import render
from testbed.store.layout import ISO9283, REPORT, RESULT
from testbed.store.npz import pretty_json
from testbed.store.whole_folder import check_free, whole_folder
from testbed.versions import all_versions, own_version


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
        if rows := sheet_rows(result):
            (folder / JOB_SHEET).write_bytes(job_csv(rows).encode())
        (folder / ISO9283).write_bytes(iso_csv(result).encode())
    return result


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
