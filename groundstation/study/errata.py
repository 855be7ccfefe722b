"""`echelon study errata`: each erratum of the paper, its literal reading against the corrected one.

All experiments run on the core alone. Each yields one number for either reading; the same numbers
every time.
"""

from collections.abc import Callable, Iterable, Iterator

import msgspec

from groundstation.study.effect import Effect
from groundstation.study.errata_control import (
    five_quarter_pi,
    leader_abeam,
    literal_y3,
    paper_gains,
)
from groundstation.study.errata_motion import arctan, euler, noise_per_step, steering_rate_schedule
from groundstation.study.errata_relative import fork_rate_input, gamma_sign


class ErrataReport(msgspec.Struct, frozen=True):
    """What the command prints."""

    mode: str
    errata: dict[str, Effect]


EXPERIMENTS: dict[str, Callable[[], Effect]] = {
    "literal-y3": literal_y3,
    "fork-rate-input": fork_rate_input,
    "euler": euler,
    "five-quarter-pi": five_quarter_pi,
    "paper-gains": paper_gains,
    "steering-rate-schedule": steering_rate_schedule,
    "gamma-sign": gamma_sign,
    "arctan": arctan,
    "leader-abeam": leader_abeam,
    "noise-per-step": noise_per_step,
}


def effects(names: Iterable[str]) -> Iterator[Effect]:
    """The named experiments, one by one as they finish."""
    for name in names:
        yield EXPERIMENTS[name]()
