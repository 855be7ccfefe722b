"""The relative filter between two recorded robots, against the motion capture.

The follower of the recording does not know that it is one: the two robots wander, and see each
other for seconds at a time. Between these sights the filter has nothing but two odometries, so it
is judged while it sees its leader, and separately over all of the time.
"""

import bisect
import math
from collections.abc import Sequence

import msgspec
import numpy as np

from groundstation.dataset_play import Played
from groundstation.dataset_score import Floats, truth_at
from groundstation.lockstep import Recording

FRESH_S = 2.0
"""A range counts as seen for so long after the follower's last bearing to its leader."""


class FollowScore(msgspec.Struct, frozen=True, kw_only=True):
    """Range and bearing of the leader as the follower estimates them.

    The bearing is relative to the follower's direction of motion. Errors are RMS while the last
    bearing to the leader is at most 2 s old (`seen_s` seconds), and of the range over all time;
    None where there is no such time. `mutual_bearings` are those that the leader takes of the
    follower. `range_mean_m` is the true range, `range_claimed_m` the standard deviation that the
    filter claims (RMS), both meanwhile.
    """

    follower: int
    leader: int
    bearings: int
    mutual_bearings: int
    longest_gap_s: float
    seen_s: float
    range_mean_m: float | None
    range_rms_m: float | None
    range_claimed_m: float | None
    bearing_rms_rad: float | None
    range_rms_always_m: float | None

    def in_words(self) -> str:
        """The result in sentences."""
        counts = (
            f"follow {self.follower}:{self.leader}: {self.bearings} bearings to robot "
            f"{self.leader}, {self.mutual_bearings} back, longest gap {self.longest_gap_s:.0f} s"
        )
        if self.range_rms_m is None or self.bearing_rms_rad is None:
            return f"{counts}; never seen while the filter ran, so there is nothing to judge"
        return (
            f"{counts}; in the {self.seen_s:.0f} s in sight range error {self.range_rms_m:.2f} m "
            f"RMS of {self.range_mean_m:.1f} m (claimed {self.range_claimed_m:.2f} m), bearing "
            f"error {self.bearing_rms_rad:.3f} rad RMS; range over all time "
            f"{self.range_rms_always_m:.2f} m RMS"
        )


def follow_score(
    follower: Recording, leader: Recording, played: Played, seconds: float
) -> FollowScore:
    """Judge the follower's estimates; both recordings start at the same instant."""
    seen = _sights(follower, leader.robot, seconds)
    t_s = np.array([t for t, _ in played.relatives], dtype=np.float64)
    own, other = truth_at(follower, t_s), truth_at(leader, t_s)
    east, north = other.x_m - own.x_m, other.y_m - own.y_m
    usable = own.usable & other.usable
    range_error = np.array([each.range_m for _, each in played.relatives]) - np.hypot(east, north)
    line_of_sight = np.arctan2(north, east) - own.direction_rad
    fork = np.interp(t_s, *_fork(played))
    estimated = np.array([each.bearing_rad for _, each in played.relatives]) - fork
    bearing_error = np.angle(np.exp(1j * (estimated - line_of_sight)))
    claimed = np.sqrt([each.covariance[0] for _, each in played.relatives])
    fresh = usable & np.array([_is_fresh(seen, t) for t in t_s.tolist()], dtype=np.bool_)
    gaps = np.diff([0.0, *seen, seconds])
    return FollowScore(
        follower=follower.robot,
        leader=leader.robot,
        bearings=len(seen),
        mutual_bearings=len(_sights(leader, follower.robot, seconds)),
        longest_gap_s=float(gaps.max()),
        seen_s=float(fresh.sum()) * (seconds / max(1, len(t_s))),
        range_mean_m=float(np.hypot(east, north)[fresh].mean()) if fresh.any() else None,
        range_rms_m=_rms(range_error[fresh]),
        range_claimed_m=_rms(claimed[fresh]),
        bearing_rms_rad=_rms(bearing_error[fresh]),
        range_rms_always_m=_rms(range_error[usable]),
    )


def _sights(recording: Recording, subject: int, seconds: float) -> list[float]:
    """When the robot saw the other one, since the recording's start."""
    times = (b.t_s - recording.start_s for b in recording.bearings if b.subject == subject)
    return [t_s for t_s in times if 0.0 <= t_s <= seconds]


def _is_fresh(seen: Sequence[float], t_s: float) -> bool:
    index = bisect.bisect_right(seen, t_s)
    return index > 0 and t_s - seen[index - 1] <= FRESH_S


def _fork(played: Played) -> tuple[Floats, Floats]:
    """Steering angle of the follower as it reports it, over time."""
    times = [t for t, _ in played.motions]
    angles = [motion.steering_rad for _, motion in played.motions]
    return np.array(times), np.unwrap(angles)


def _rms(values: Floats) -> float | None:
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else None
