"""report.html of a calibration: one self-contained page, how good it is on held-out poses first."""

from collections.abc import Mapping

from testbed.output.calibration_report_data import data_section, delivered_section, record_section
from testbed.output.calibration_report_errors import (
    accuracy_section,
    belief_section,
    outlier_section,
    residual_section,
)
from testbed.output.calibration_report_parameters import (
    identifiable_section,
    parameter_section,
)
from testbed.output.calibration_words import (
    HEAD,
    headline_rows,
    mark,
    next_step,
    notice,
    reasons,
    verdict,
)
from testbed.output.report import Page, render
from testbed.output.report_parts import Table
from testbed.records_calibration import Calibration, Delivered


def calibration_report_html(
    calibration: Calibration, delivered: Delivered, *, versions: Mapping[str, str]
) -> str:
    """The report of a calibration as one HTML page: no network, same bytes each time.

    Parameters
    ----------
    calibration : Calibration
        As `testbed.calibration.calibrate` gives it.
    delivered : Delivered
        What was written beside it.
    versions : mapping of str to str
        Program and packages.
    """
    return render(page_of(calibration, delivered, versions))


def page_of(calibration: Calibration, delivered: Delivered, versions: Mapping[str, str]) -> Page:
    """The content of the page; sections without data are left out."""
    source = calibration.source
    sections = (
        accuracy_section(calibration),
        belief_section(calibration),
        residual_section(calibration),
        outlier_section(calibration),
        parameter_section(calibration),
        identifiable_section(calibration),
        delivered_section(delivered),
        data_section(calibration),
        record_section(calibration, versions),
    )
    return Page(
        banner=notice(calibration),
        title=f"{source.robot_title}: {source.name}",
        subtitle=f"Session {source.name}, robot {source.robot}, seed {calibration.split.seed}; "
        f"{calibration.split.sentence}.",
        believable=not calibration.contradicted,
        mark=mark(calibration),
        verdict=verdict(calibration),
        reasons=reasons(calibration),
        headline=headline(calibration),
        next_step=next_step(calibration),
        sections=tuple(section for section in sections if section is not None),
    )


def headline(calibration: Calibration) -> Table:
    """Before and after, every model."""
    rows = headline_rows(calibration)
    chosen = 1 + [fit.model for fit in calibration.fits].index(calibration.choice.chosen)
    held = calibration.split.is_test.any()
    where = "held-out rows, never used for identification" if held else "the rows identified from"
    return Table(
        caption=f"Errors at {where}: seen minus predicted",
        head=HEAD,
        rows=tuple(rows),
        align="l" + "r" * (len(HEAD) - 1),
        strong=(chosen,),
        size="small",
        note="Errors hold the measuring noise, too. First row: the links as the maker describes "
        "them, with base, tool and fixtures fitted to the training poses: without that fit no "
        "error can be told at all. training mean: at the rows identified from. χ²/dof: residuals "
        "of the identification against the stated noise. cond.: of the scaled Jacobian of the "
        "kept numbers. rank: directions that the data tell apart.",
    )
