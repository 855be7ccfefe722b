"""The fault campaign: `python -m tests.campaign`, see docs/campaign.md.

Every run is kept in a file of JSON lines under build/campaign; an interrupted campaign goes on
there. `double` runs random pairs of faults instead of the matrix, `docs` writes the page from what
is there, `list` prints the pairs that seeds stand for.
"""

import argparse
import sys
import time
from collections.abc import Iterator

import msgspec

from tests.campaign import double, report, single
from tests.campaign.journal import FOLDER, Journal
from tests.campaign.witness import Outcome


def main() -> int:
    """Run what is missing; returns 0 where every run is as it has to be."""
    parser = argparse.ArgumentParser(prog="tests.campaign", description=__doc__)
    parser.add_argument("what", nargs="?", default="single", choices=list(_MODES))
    parser.add_argument("--only", nargs="*", default=[""], help="parts of keys, as bearing/stuck")
    parser.add_argument("--seed", type=int, default=1, help="of the fleet, for single faults")
    parser.add_argument("--runs", type=int, default=500, help="double faults: seeds 1 to this")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results")
    options = parser.parse_args()
    return _MODES[options.what](options)


def _single(options: argparse.Namespace) -> int:
    cases = [c for c in single.matrix() if any(part in c.key for part in options.only)]
    with Journal(FOLDER / f"single-{options.seed}.jsonl", "single.py", options.fresh) as journal:
        missing = [case for case in cases if case.key not in journal.done]
        for key, result in _shown(single.run(missing, options.seed, options.jobs), len(missing)):
            journal.add(key, result)
    done = report.runs((case, _outcome(journal, case.key)) for case in cases)
    for run in done:
        for problem in run.verdict.problems:
            print(f"{run.case.key}: {problem}")
    print(report.matrix_summary(done))
    return 1 if any(run.verdict.problems for run in done) else 0


def _double(options: argparse.Namespace) -> int:
    pairs = double.pairs(range(1, options.runs + 1))
    with Journal(FOLDER / "double.jsonl", "double.py", options.fresh) as journal:
        missing = [pair for pair in pairs if pair.key not in journal.done]
        for key, result in _shown(double.run(missing, options.jobs), len(missing)):
            journal.add(key, result)
    done = [(pair, _outcome(journal, pair.key)) for pair in pairs]
    print(report.double_summary(done))
    return 1 if any(double.problems(pair, outcome) for pair, outcome in done) else 0


def _docs(options: argparse.Namespace) -> int:
    """Write the page from finished runs; nothing is run."""
    with Journal(FOLDER / f"single-{options.seed}.jsonl", "single.py") as journal:
        cases = [case for case in single.matrix() if case.key in journal.done]
    with Journal(FOLDER / "double.jsonl", "double.py") as doubles:
        pairs = [double.drawn(int(key)) for key in doubles.done]
    done = report.runs((case, _outcome(journal, case.key)) for case in cases)
    report.written(
        {
            "summary": report.matrix_summary(done),
            "matrix": report.matrix_tables(done),
            "double": report.double_summary([(p, _outcome(doubles, p.key)) for p in pairs]),
        }
    )
    return 0


def _list(options: argparse.Namespace) -> int:
    for seed in range(1, options.runs + 1):
        print(double.drawn(seed).told)
    return 0


def _outcome(journal: Journal, key: str) -> Outcome:
    return msgspec.json.decode(journal.done[key], type=Outcome)


def _shown(results: Iterator[tuple[str, bytes]], total: int) -> Iterator[tuple[str, bytes]]:
    """The same results, with a line of progress for each."""
    began_s = time.monotonic()
    for number, (key, result) in enumerate(results, 1):
        yield key, result
        passed_s = time.monotonic() - began_s
        print(f"{number}/{total} after {passed_s:.0f} s: {key}", file=sys.stderr, flush=True)


_MODES = {"single": _single, "double": _double, "docs": _docs, "list": _list}

if __name__ == "__main__":
    sys.exit(main())
