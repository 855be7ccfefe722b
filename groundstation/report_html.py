"""A report as one HTML file that needs nothing else: figures are in it, no script, no request."""

from base64 import b64encode
from collections.abc import Iterator, Sequence
from html import escape
from io import BytesIO

from matplotlib import rc_context
from matplotlib.figure import Figure

from config.loader import dump_effective
from groundstation.report_data import Happening, Told, happenings
from groundstation.report_figures import Picture
from groundstation.report_tables import (
    Table,
    comparison,
    judgement,
    loops,
    run_facts,
    versions,
)

STYLE = """
:root { color-scheme: light dark; --ink: #22303c; --soft: #5c6b77; --paper: #ffffff;
  --line: #dde4ea; --panel: #f5f8fa; --good: #17795e; --bad: #b3273c; --figure: #ffffff; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --soft: #9fb0bd; --paper: #12181d;
  --line: #2c3a45; --panel: #1a232b; --good: #4cc9a0; --bad: #ff7a8a; --figure: #f4f6f8; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem; max-width: 70rem; color: var(--ink);
  background: var(--paper); font: 16px/1.5 system-ui, sans-serif; }
body.two { max-width: 110rem; }
h1 { font-size: 1.6rem; margin: 0 0 0.2rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 0.4rem; border-bottom: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1rem 0 0.3rem; overflow-wrap: anywhere; }
nav a { margin-right: 1rem; color: var(--soft); }
.runs { display: grid; gap: 1.5rem; grid-template-columns: minmax(0, 1fr); }
.two .runs { grid-template-columns: repeat(2, minmax(0, 1fr)); }
@media (max-width: 50rem) { .two .runs { grid-template-columns: minmax(0, 1fr); } }
.verdict { display: inline-block; padding: 0.1rem 0.8rem; border-radius: 1rem; font-weight: 600;
  color: #fff; background: #17795e; }
.verdict.bad { background: #b3273c; }
.why { color: var(--bad); margin: 0.5rem 0; padding-left: 1.2rem; }
table { border-collapse: collapse; margin: 0.4rem 0 1rem; font-size: 0.9rem;
  font-variant-numeric: tabular-nums; }
th { text-align: left; color: var(--soft); font-weight: 500; }
th, td { padding: 0.15rem 0.9rem 0.15rem 0; border-bottom: 1px solid var(--line);
  vertical-align: top; overflow-wrap: anywhere; }
.wide { overflow-x: auto; }
tr.good td:last-child::after { content: " met"; color: var(--good); }
tr.bad td { color: var(--bad); }
tr.bad td:last-child::after { content: " missed"; }
tr.error td, tr.FAULT td, tr.ESTOP td { color: var(--bad); }
.plain tr.bad td:last-child::after { content: ""; }
figure { margin: 0; }
figure img { width: 100%; border-radius: 6px; background: var(--figure); display: block; }
figcaption { color: var(--soft); font-size: 0.9rem; margin: 0.2rem 0 0.6rem; }
pre { background: var(--panel); padding: 0.8rem; overflow: auto; max-height: 30rem;
  font-size: 0.8rem; border-radius: 6px; }
summary { cursor: pointer; color: var(--soft); }
@media print { body { max-width: none; padding: 0; } nav { display: none; }
  figure, table { break-inside: avoid; } }
"""


def page(runs: Sequence[Told], drawn: Sequence[Sequence[Picture]]) -> str:
    """The whole report on one run, or on two beside each other; figures of each run in `drawn`."""
    title = "Run report: " + " and ".join(told.fleet.name for told in runs)
    headings = {each.name: each.heading for run in drawn for each in run}
    links = [("summary", "Summary"), *headings.items(), ("log", "Log"), ("versions", "Versions")]
    parts = [
        "<!doctype html>",
        f'<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<style>{STYLE}</style></head>",
        f'<body class="{"two" if len(runs) > 1 else "one"}"><h1>{escape(title)}</h1>',
        "<nav>",
        *(f'<a href="#{name}">{escape(text)}</a>' for name, text in links),
        "</nav>",
        *_section("summary", "Summary", [_summary(told) for told in runs]),
    ]
    if len(runs) > 1:
        parts.append(_table(comparison(runs[0], runs[1])))
    for name, heading in headings.items():
        cells = [
            "".join(_figure(each) for each in run if each.name == name)
            or "<p>Nothing of it in this recording.</p>"
            for run in drawn
        ]
        parts += _section(name, heading, cells)
    parts += _section("log", "Log", [_log(happenings(told)) for told in runs])
    parts += _section("versions", "Versions and configuration", [_basis(told) for told in runs])
    return "\n".join([*parts, "</body></html>", ""])


def _section(name: str, heading: str, cells: Sequence[str]) -> Iterator[str]:
    yield f'<section id="{name}"><h2>{escape(heading)}</h2><div class="runs">'
    yield from (f"<div>{cell}</div>" for cell in cells)
    yield "</div></section>"


def _summary(told: Told) -> str:
    judged = told.judged
    bad = judged.verdict != "pass"
    why = "".join(f"<li>{escape(text)}</li>" for text in judged.why)
    return "".join(
        (
            f'<p><span class="verdict{" bad" if bad else ""}">{judged.verdict}</span></p>',
            f'<ul class="why">{why}</ul>' if why else "",
            _table(run_facts(told)),
            _table(judgement(told)),
            f'<div class="plain">{_table(loops(told))}</div>',
        )
    )


def _table(table: Table) -> str:
    heads = "".join(f"<th>{escape(head)}</th>" for head in table.heads)
    rows = "".join(
        f'<tr class="{row.mark}">'
        + "".join(f"<td>{escape(cell)}</td>" for cell in row.cells)
        + "</tr>"
        for row in table.rows
    )
    head = f"<thead><tr>{heads}</tr></thead>" if any(table.heads) else ""
    return (
        f'<h3>{escape(table.heading)}</h3><div class="wide"><table>{head}'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _log(found: Sequence[Happening]) -> str:
    if not found:
        return "<p>No message of any robot.</p>"
    rows = "".join(
        f'<tr class="{escape(each.kind)}"><td>{each.time_s:.2f} s</td><td>{escape(each.robot)}</td>'
        f"<td>{escape(each.kind)}</td><td>{escape(each.text)}</td></tr>"
        for each in found
    )
    return f'<div class="wide"><table><tbody>{rows}</tbody></table></div>'


def _basis(told: Told) -> str:
    return (
        f"<details><summary>Versions</summary>{_table(versions(told))}</details>"
        f"<details><summary>Effective fleet file</summary>"
        f"<pre>{escape(dump_effective(told.fleet))}</pre></details>"
    )


def _figure(picture: Picture) -> str:
    data = b64encode(_svg(picture.figure)).decode()
    return (
        f'<figure><figcaption>{escape(picture.caption)}</figcaption><img alt="'
        f'{escape(picture.heading)}" src="data:image/svg+xml;base64,{data}"></figure>'
    )


def _svg(figure: Figure) -> bytes:
    drawn = BytesIO()
    with rc_context({"svg.hashsalt": "echelon"}):
        figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    return drawn.getvalue()
