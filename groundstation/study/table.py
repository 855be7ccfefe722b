"""The numbers of `echelon study paper`: as one document, and as Markdown."""

import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence

import msgspec

from groundstation.study.bound_cells import BoundResult
from groundstation.study.formation_cells import FollowerResult, FormationResult
from groundstation.study.leader_cells import LeaderResult, rms

LOST_M = 0.15
"""A follower further than a third of the spacing from its place, RMS, has lost the formation."""


class LeaderRow(msgspec.Struct, frozen=True):
    """One filter with one number of landmarks, from 0.5 s on.

    `rmse_m` is pooled over time and seeds, as the bound is; `mean_rmse_m` is the mean over seeds of
    each seed's RMSE. `nees` should be 4, `nis` 1.
    """

    rmse_m: float
    mean_rmse_m: float
    worst_rmse_m: float
    bound_m: float
    ratio: float
    heading_rmse_rad: float
    nees: float
    nis: float | None


class FollowerRow(msgspec.Struct, frozen=True):
    """One follower: errors of the formation, of the estimate, and what the filter claims.

    RMS values are pooled; `place_median_m` is the median seed's, and `lost` counts the seeds whose
    place is off by more than `LOST_M` RMS. `alpha_max` is the mean over seeds of each seed's
    largest error of the direction angle, `alpha_worst` the largest of all. `nees` should be 3,
    `nis` 1.
    """

    place_rms_m: float
    place_median_m: float
    lost: int
    range_rms_m: float
    bearing_rms_rad: float
    est_range_rms_m: float
    est_bearing_rms_rad: float
    est_alpha_rms_rad: float
    alpha_max_rad: float
    alpha_worst_rad: float
    nees: float
    nis: float


class LockstepRow(msgspec.Struct, frozen=True):
    """One follower in lockstep."""

    place_rms_m: float | None
    range_rms_m: float | None
    bearing_rms_rad: float | None
    alpha_max_at_switchings_rad: float
    alpha_max_rad: float


class Figure4(msgspec.Struct, frozen=True):
    """Core alone: filter -> number of landmarks -> row."""

    mode: str
    filters: dict[str, dict[str, LeaderRow]]


class Figure5(msgspec.Struct, frozen=True):
    """Core alone: filter and odometry -> follower -> row; in lockstep: follower -> row."""

    core_alone: dict[str, dict[str, FollowerRow]]
    lockstep_seed: int
    lockstep: dict[str, LockstepRow]


class PaperTable(msgspec.Struct, frozen=True):
    """Section 4 of the paper in numbers."""

    seeds: int
    figure4: Figure4 | None = None
    figure5: Figure5 | None = None
    files: list[str] = []


def leader_row(results: Sequence[LeaderResult], bounds: Sequence[BoundResult]) -> LeaderRow:
    """One row from the results of all seeds."""
    each = [math.sqrt(result.position_mse_m2) for result in results]
    pooled = rms([result.position_mse_m2 for result in results])
    bound_m = rms([bound.position_mse_m2 for bound in bounds])
    nis = [result.nis for result in results if result.nis is not None]
    return LeaderRow(
        rmse_m=pooled,
        mean_rmse_m=_mean(each),
        worst_rmse_m=max(each),
        bound_m=bound_m,
        ratio=pooled / bound_m,
        heading_rmse_rad=rms([result.heading_mse_rad2 for result in results]),
        nees=_mean([result.nees for result in results]),
        nis=_mean(nis) if nis else None,
    )


def follower_rows(results: Sequence[FormationResult]) -> dict[str, FollowerRow]:
    """A row per follower from the results of all seeds."""
    return {
        name: _follower_row([result.followers[name] for result in results])
        for name in results[0].followers
    }


def _follower_row(results: Sequence[FollowerResult]) -> FollowerRow:
    def pooled(square: Callable[[FollowerResult], float]) -> float:
        return rms([square(result) for result in results])

    places = [math.sqrt(result.place_mse_m2) for result in results]
    return FollowerRow(
        place_rms_m=pooled(lambda r: r.place_mse_m2),
        place_median_m=statistics.median(places),
        lost=sum(place > LOST_M for place in places),
        range_rms_m=pooled(lambda r: r.range_mse_m2),
        bearing_rms_rad=pooled(lambda r: r.bearing_mse_rad2),
        est_range_rms_m=pooled(lambda r: r.est_range_mse_m2),
        est_bearing_rms_rad=pooled(lambda r: r.est_bearing_mse_rad2),
        est_alpha_rms_rad=pooled(lambda r: r.est_heading_mse_rad2),
        alpha_max_rad=_mean([r.heading_max_rad for r in results]),
        alpha_worst_rad=max(r.heading_max_rad for r in results),
        nees=_mean([r.nees for r in results]),
        nis=_mean([r.nis for r in results]),
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def to_json(table: PaperTable) -> bytes:
    """The document, indented."""
    return msgspec.json.format(msgspec.json.encode(table), indent=2) + b"\n"


def to_markdown(table: PaperTable) -> str:
    """The same as tables for people."""
    parts = [f"# Section 4 of the paper, {table.seeds} seeds\n"]
    if table.figure4 is not None:
        parts += _leader_markdown(table.figure4)
    if table.figure5 is not None:
        parts += _formation_markdown(table.figure5)
    return "\n".join(parts)


def _leader_markdown(figure: Figure4) -> Iterable[str]:
    for name, rows in figure.filters.items():
        yield f"## Figure 4, leader: {name} ({figure.mode})\n"
        yield _grid(
            "landmarks | RMSE [m] | mean of seeds | worst seed | bound [m] | ratio | heading [rad] "
            "| NEES (4) | NIS (1)",
            {
                count: (
                    f"{row.rmse_m:.4f} | {row.mean_rmse_m:.4f} | {row.worst_rmse_m:.4f} | "
                    f"{row.bound_m:.4f} | {row.ratio:.3f} | {row.heading_rmse_rad:.4f} | "
                    f"{row.nees:.2f} | {'-' if row.nis is None else f'{row.nis:.3f}'}"
                )
                for count, row in rows.items()
            },
        )


def _formation_markdown(figure: Figure5) -> Iterable[str]:
    yield f"## Figure 5, formation: in lockstep, fleet paper, seed {figure.lockstep_seed}\n"
    yield _grid(
        "follower | place [m] | range [m] | bearing [rad] | alpha error max [rad] "
        "| at the switchings",
        {
            name: (
                f"{_known(row.place_rms_m)} | {_known(row.range_rms_m)} | "
                f"{_known(row.bearing_rms_rad)} | {row.alpha_max_rad:.4f} | "
                f"{row.alpha_max_at_switchings_rad:.4f}"
            )
            for name, row in figure.lockstep.items()
        },
    )
    for cell, rows in figure.core_alone.items():
        yield f"## Figure 5, formation: {cell} (core alone)\n"
        yield _grid(
            "follower | place [m] | median | lost | range [m] | bearing [rad] | est. range "
            "| est. bearing "
            "| est. alpha | alpha max, mean | alpha max, worst | NEES (3) | NIS (1)",
            {
                name: (
                    f"{row.place_rms_m:.4f} | {row.place_median_m:.4f} | {row.lost} | "
                    f"{row.range_rms_m:.4f} | {row.bearing_rms_rad:.4f} | "
                    f"{row.est_range_rms_m:.4f} | {row.est_bearing_rms_rad:.4f} | "
                    f"{row.est_alpha_rms_rad:.4f} | {row.alpha_max_rad:.4f} | "
                    f"{row.alpha_worst_rad:.4f} | {row.nees:.2f} | {row.nis:.3f}"
                )
                for name, row in rows.items()
            },
        )


def _known(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"


def _grid(heading: str, rows: Mapping[str, str]) -> str:
    rule = "|".join("---" for _ in heading.split("|"))
    lines = [f"| {heading} |", f"|{rule}|", *(f"| {key} | {row} |" for key, row in rows.items())]
    return "\n".join(lines) + "\n"
