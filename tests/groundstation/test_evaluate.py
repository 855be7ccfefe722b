"""A run is judged by truth: known errors in, the same errors and a verdict out."""

import math
from collections.abc import Iterable

import pytest

from groundstation.evaluate import evaluate
from groundstation.series import gather
from groundstation.summary import Fault, Mode, Summary
from tests.groundstation.synthetic import Place, Story, behind, fleet, messages


def _judge(
    story: Story,
    law: str = "leader_frame",
    mode: Mode = "lockstep",
    drop: str = "-",
    incidents: Iterable[Fault] = (),
) -> Summary:
    run = gather((key, body) for key, body, _ in messages(story) if not key.startswith(drop))
    return evaluate(
        fleet(law), run, mode=mode, seed=7, recording="run.mcap", incidents=tuple(incidents)
    )


def test_a_perfect_run_passes_with_zero_errors() -> None:
    judged = _judge(Story())
    assert (judged.verdict, judged.why) == ("pass", [])
    follower = judged.followers["r2"]
    assert follower.position_rms_m == pytest.approx(0.0, abs=1e-12)
    assert follower.range_rms_m == pytest.approx(0.0, abs=1e-12)
    assert follower.bearing_rms_rad == pytest.approx(0.0, abs=1e-12)
    assert judged.leader.position_rmse_m == pytest.approx(0.0, abs=1e-9)
    assert judged.mission.completed
    assert judged.mission.seconds_judged == pytest.approx(15.0)
    assert judged.mission.law == {"r2": "leader_frame"}


def test_a_follower_off_its_place_has_that_position_range_and_bearing_error() -> None:
    # From (-0.9, 0.7) instead of (-1, 0.5) the leader is seen at distance sqrt(1.3), desired
    # sqrt(1.25), and at atan2(-0.7, 0.9), desired atan2(-0.5, 1).
    follower = _judge(Story(follower=behind(0.1, 0.2))).followers["r2"]
    assert follower.position_rms_m == pytest.approx(0.2236067977, abs=1e-9)
    assert follower.range_rms_m == pytest.approx(abs(1.1401754251 - 1.1180339887), abs=1e-9)
    assert follower.bearing_rms_rad == pytest.approx(0.6610431689 - 0.4636476090, abs=1e-9)


def test_the_bearing_error_is_in_the_followers_own_body_frame() -> None:
    follower = _judge(Story(follower=behind(heading_rad=0.3))).followers["r2"]
    assert follower.position_rms_m == pytest.approx(0.0, abs=1e-12)
    assert follower.bearing_rms_rad == pytest.approx(0.3)


def test_the_position_error_is_in_the_leaders_body_frame() -> None:
    def leader(t_s: float) -> Place:
        return Place(0.0, t_s, math.pi / 2)

    def follower(t_s: float) -> Place:
        return Place(-0.5, t_s - 1.0, math.pi / 2)

    errors = _judge(Story(leader=leader, follower=follower)).followers["r2"]
    assert errors.position_rms_m == pytest.approx(0.0, abs=1e-12)


def test_an_error_before_the_judged_window_does_not_count() -> None:
    def late(t_s: float) -> Place:
        return behind(0.3 if t_s < 4.9 else 0.0)(t_s)

    assert _judge(Story(follower=late)).verdict == "pass"


def test_each_law_has_its_own_bars() -> None:
    turned = Story(follower=behind(heading_rad=0.3))
    assert _judge(turned, "leader_frame").verdict == "pass"
    polar = _judge(turned, "polar")
    assert polar.verdict == "fail"
    assert polar.why == ["r2 bearing error 0.3000 rad RMS exceeds the limit 0.06 rad"]


def test_a_missed_position_bar_is_named_with_value_and_limit() -> None:
    judged = _judge(Story(follower=behind(0.05)))
    assert judged.why == ["r2 position error 0.0500 m RMS exceeds the limit 0.04 m"]


def test_the_leaders_estimate_is_judged_against_truth() -> None:
    judged = _judge(Story(pose_error_m=0.2))
    assert judged.leader.position_rmse_m == pytest.approx(0.2)
    assert judged.leader.heading_rmse_rad == pytest.approx(0.0, abs=1e-12)
    assert judged.why == ["r1 pose estimate error 0.2000 m RMS exceeds the limit 0.09 m"]


def test_the_followers_estimate_is_compared_with_truth() -> None:
    estimation = _judge(Story()).estimation["r2"]
    assert estimation.range_rmse_m == pytest.approx(0.1)
    assert estimation.bearing_rmse_rad == pytest.approx(0.02)
    assert estimation.heading_rmse_rad == pytest.approx(0.0, abs=1e-12)


def test_coming_too_close_counts_episodes_over_the_whole_run() -> None:
    def swerving(t_s: float) -> Place:
        near = 1.0 <= t_s < 1.5 or 3.0 <= t_s < 3.5
        return Place(t_s - (0.1 if near else 1.0), 0.0 if near else 0.5, 0.0)

    judged = _judge(Story(follower=swerving))
    assert judged.collisions == 2
    assert judged.min_distance_m == pytest.approx(0.1)
    assert judged.verdict == "fail"
    assert "0.100 m is below the limit 0.15 m (collisions: 2)" in judged.why[0]


def test_a_fault_fails_the_run_and_is_told_with_its_time() -> None:
    judged = _judge(Story(final_state="FAULT", ends_with="drive heartbeat missing for 0.35 s"))
    assert judged.faults[0] == Fault("r1", 20.02, "FAULT: drive heartbeat missing for 0.35 s")
    assert not judged.mission.completed
    assert judged.verdict == "fail"
    assert any("drive heartbeat missing" in text for text in judged.why)


def test_an_incident_outside_the_messages_fails_the_run() -> None:
    judged = _judge(Story(), incidents=[Fault("r2", 3.0, "process ended: signal SIGKILL")])
    assert judged.why == ["r2 at 3.00 s: process ended: signal SIGKILL"]


def test_a_stopped_mission_is_not_completed() -> None:
    judged = _judge(Story(duration_s=12.0, ends_with="stopped by operator"))
    assert not judged.mission.completed
    assert judged.mission.seconds_judged == pytest.approx(7.0)
    assert judged.why == [
        f"mission not completed: {name} ended with 'stopped by operator', "
        "not with 'mission complete'"
        for name in ("r1", "r2")
    ]


def test_a_run_without_a_mission_fails_with_nothing_judged() -> None:
    judged = _judge(Story(), drop="echelon/pair/r1/motion")
    assert judged.verdict == "fail"
    assert judged.mission.seconds_judged == 0
    assert judged.followers["r2"].position_rms_m is None
    assert judged.why[0] == "mission not completed: r1 never started it"


def test_a_run_without_truth_cannot_pass() -> None:
    judged = _judge(Story(), drop="truth/")
    assert judged.verdict == "fail"
    assert judged.min_distance_m is None
    assert "r2 position error: nothing to judge" in judged.why[0]


def test_overruns_count_only_where_real_processes_ran() -> None:
    late = Story(overruns=20)
    assert _judge(late, mode="lockstep").verdict == "pass"
    assert _judge(late, mode="processes").why == [
        "r1 control loop: 20 of 1000 cycles overran, limit 1.0%",
        "r2 control loop: 20 of 1000 cycles overran, limit 1.0%",
    ]
    assert _judge(Story(overruns=10), mode="processes").verdict == "pass"
