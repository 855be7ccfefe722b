"""`echelon report`: one HTML file and one PDF about a run, or about two beside each other."""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from groundstation.errors import GroundError
from groundstation.report_data import read_told
from groundstation.report_figures import pictures
from groundstation.report_html import page
from groundstation.report_pdf import write_pdf

MOST_RUNS = 2
HTML, PDF = "report.html", "report.pdf"


class ReportedRun(msgspec.Struct, frozen=True):
    """A run in the report, and how it was judged."""

    recording: str
    verdict: str
    why: list[str]


class Written(msgspec.Struct, frozen=True):
    """The files of a report."""

    html: str
    pdf: str
    runs: list[ReportedRun]


def write_report(paths: Sequence[Path], out: Path | None = None) -> Written:
    """Write report.html and report.pdf into `out`, or beside the first recording.

    Raises GroundError when a file is no whole recording, or nothing can be written.
    """
    if len(paths) > MOST_RUNS:
        raise GroundError(f"{len(paths)} recordings: a report is about one run, or about two")
    runs = [read_told(path) for path in paths]
    drawn = [list(pictures(told)) for told in runs]
    folder = out if out is not None else paths[0].parent
    html, pdf = folder / HTML, folder / PDF
    try:
        folder.mkdir(parents=True, exist_ok=True)
        html.write_text(page(runs, drawn), encoding="utf-8")
        write_pdf(pdf, runs, drawn)
    except OSError as error:
        raise GroundError(f"cannot write the report into {folder}: {error.strerror}") from error
    return Written(
        str(html),
        str(pdf),
        [ReportedRun(str(told.path), told.judged.verdict, told.judged.why) for told in runs],
    )
