"""Advice on settings that are allowed but work badly."""

from config.fleet import Fleet


def warnings(fleet: Fleet) -> list[str]:
    """Every piece of advice, one line each; empty when there is none."""
    return [*_high_gains(fleet), *_paper_filters(fleet)]


def _paper_filters(fleet: Fleet) -> list[str]:
    return [
        f"robots.{name}.relative_filter.kind: `paper` starts with a deviation of 1.06 m on every "
        "range and cannot tell it while driving straight; followers came within 0.07 m of their "
        "leader with it: use it to listen, not to drive; `ukf` is the filter for robots"
        for name, robot in fleet.robots.items()
        if robot.offset is not None and robot.relative_filter.kind == "paper"
    ]


def _high_gains(fleet: Fleet) -> list[str]:
    """Feedback gains too high for speed, steering lag and latency.

    With the steering a lag tau, a follower at speed V with lever L (its wheelbase, or the leader's
    distance ahead of its rear axle for law `polar`) is well damped while
    tau <= 1 / (2 (k + V / L)); a delay T of the measurements asks for k <= 0.2 / T.
    """
    speed_mps = max(segment.speed_mps for segment in fleet.mission.segments)
    lag_s = fleet.simulation.steering.lag_s
    found = []
    for name, robot in fleet.robots.items():
        if robot.offset is None:
            continue
        polar = robot.formation.law == "polar"
        lever_m = robot.vehicle.wheelbase_m - (robot.offset.x_m if polar else 0.0)
        delay_s = fleet.simulation.bearings.latency_s + 2.0 / robot.loop.rate_hz
        highest = min(0.5 / lag_s - speed_mps / lever_m, 0.2 / delay_s)
        if robot.formation.gain_per_s > highest:
            advice = f"at most {highest:.2g}/s" if highest > 0 else "no gain is low enough"
            found.append(
                f"robots.{name}.formation.gain_per_s: {robot.formation.gain_per_s:g}/s is high for "
                f"{speed_mps:g} m/s with a steering lag of {lag_s:g} s and a measurement delay of "
                f"{delay_s:g} s: {advice}; drive slower, lower the gain or use faster steering"
            )
    return found
