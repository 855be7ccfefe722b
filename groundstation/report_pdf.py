"""A report as a PDF: a page of text, then the figures of each run, then the log."""

import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

from matplotlib import rc_context
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from groundstation.report_data import Told, happenings
from groundstation.report_figures import Picture
from groundstation.report_tables import (
    BAD,
    Table,
    comparison,
    judgement,
    loops,
    run_facts,
    versions,
)
from groundstation.study.drawing import INK

PAGE_IN = (8.27, 11.69)
TOP, LEFT, LINE = 0.95, 0.07, 0.0155
LINES_PER_PAGE = 56
WRAP = 96
GOOD_COLOUR, BAD_COLOUR, SOFT = "#17795e", "#b3273c", "#5c6b77"
Line = tuple[str, str, float]
"""Text, colour and size [points] of one line of a page."""


def write_pdf(path: Path, runs: Sequence[Told], drawn: Sequence[Sequence[Picture]]) -> None:
    """Write the report. Raises OSError."""
    metadata = {"Title": "Echelon run report", "CreationDate": None, "Creator": None}
    with rc_context({"pdf.fonttype": 42}), PdfPages(path, metadata=metadata) as pdf:
        for told, figures in zip(runs, drawn, strict=True):
            for figure in _text_pages(list(_first_page(told, runs))):
                pdf.savefig(figure)
            for picture in figures:
                pdf.savefig(_titled(picture, told, len(runs) > 1))
            for figure in _text_pages(list(_log(told))):
                pdf.savefig(figure)


def _titled(picture: Picture, told: Told, several: bool) -> Figure:
    which = f"  {told.path}" if several else ""
    title = picture.figure.suptitle(
        f"{picture.heading}{which}", x=0.01, ha="left", color=INK, fontsize=11
    )
    title.set_wrap(True)
    return picture.figure


def _first_page(told: Told, runs: Sequence[Told]) -> Iterator[Line]:
    passed = told.judged.verdict == "pass"
    yield f"Run report: fleet {told.fleet.name}", INK, 16
    yield "", INK, 9
    yield f"verdict: {told.judged.verdict}", GOOD_COLOUR if passed else BAD_COLOUR, 13
    for why in told.judged.why:
        for line in textwrap.wrap(why, WRAP, initial_indent="- ", subsequent_indent="  "):
            yield line, BAD_COLOUR, 8
    for table in (run_facts(told), judgement(told), loops(told)):
        yield from _table(table)
    if len(runs) > 1:
        yield from _table(comparison(runs[0], runs[1]))
    yield from _table(versions(told))


def _log(told: Told) -> Iterator[Line]:
    yield "Log", INK, 12
    for each in happenings(told):
        text = f"{each.time_s:8.2f} s  {each.robot:<8} {each.kind:<9} {each.text}"
        colour = BAD_COLOUR if each.kind in ("error", "FAULT", "ESTOP") else INK
        for line in textwrap.wrap(text, WRAP, subsequent_indent=" " * 31):
            yield line, colour, 7.5


def _table(table: Table) -> Iterator[Line]:
    yield "", INK, 9
    yield table.heading, INK, 11
    rows = [table.heads, *(row.cells for row in table.rows)]
    columns = max(len(cells) for cells in rows)
    widths = [
        max((len(cells[n]) for cells in rows if n < len(cells)), default=0) for n in range(columns)
    ]
    if any(table.heads):
        yield _cells(table.heads, widths), SOFT, 7.5
    for row in table.rows:
        yield _cells(row.cells, widths), BAD_COLOUR if row.mark == BAD else INK, 7.5


def _cells(cells: Sequence[str], widths: Sequence[int]) -> str:
    padded = [f"{cell:<{width}}" for cell, width in zip(cells, widths, strict=False)]
    return "  ".join(padded).rstrip()


def _text_pages(lines: Sequence[Line]) -> Iterator[Figure]:
    for first in range(0, len(lines), LINES_PER_PAGE):
        figure = Figure(figsize=PAGE_IN)
        for number, (text, colour, size) in enumerate(lines[first : first + LINES_PER_PAGE]):
            family = "monospace" if size < 9 else "sans-serif"
            y = TOP - number * LINE
            figure.text(LEFT, y, text, color=colour, fontsize=size, family=family, va="top")
        yield figure
