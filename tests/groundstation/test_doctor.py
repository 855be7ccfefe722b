"""`echelon doctor --mission`: shipped fleets pass, fleets made bad on purpose do not."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from config.fleet import Acceptance, Fleet, Marker, Mission, Robot, Segment
from config.loader import dump_effective
from groundstation.cli import app
from groundstation.exits import NOT_GOOD, UNUSABLE
from groundstation.study.mission_check import MissionReport, check_mission
from groundstation.study.planned_paths import planned_paths
from tests.hil.fleets import shipped, straight


def _report(fleet: Fleet) -> MissionReport:
    return check_mission(fleet).report


def _with_robot(fleet: Fleet, name: str, **changes: object) -> Fleet:
    robots = {**fleet.robots, name: fleet.robots[name].model_copy(update=changes)}
    return fleet.model_copy(update={"robots": robots})


def _every(fleet: Fleet, section: str, **changes: object) -> Fleet:
    """The fleet with one section of every robot changed."""

    def changed(robot: Robot) -> Robot:
        return robot.model_copy(
            update={section: getattr(robot, section).model_copy(update=changes)}
        )

    robots = {name: changed(robot) for name, robot in fleet.robots.items()}
    return fleet.model_copy(update={"robots": robots})


def _circle(speed_mps: float, rate_radps: float) -> Fleet:
    segment = Segment(duration_s=5.0, speed_mps=speed_mps, fork_rate_radps=rate_radps)
    return shipped("demo").model_copy(
        update={"mission": Mission(segments=[segment], acceptance=Acceptance(from_s=1.0))}
    )


def _errors(report: MissionReport, check: str) -> list[str]:
    return [
        str(finding)
        for finding in report.findings
        if finding.check == check and finding.severity == "error"
    ]


@pytest.mark.parametrize("name", ["demo", "hardware"])
def test_slow_shipped_fleets_are_without_findings(name: str) -> None:
    report = _report(shipped(name))
    assert report.findings == []
    assert report.ok
    assert all(robot.weak_s == 0.0 for robot in report.robots.values())


def test_the_paper_s_fleet_at_four_metres_a_second_has_warnings_only() -> None:
    report = _report(shipped("paper"))
    assert report.ok
    assert {finding.check for finding in report.findings} == {
        "acceleration",
        "braking",
        "steering_loop",
    }


def test_planned_steering_is_that_of_the_theory() -> None:
    """asin(omega d / v) for the paper's schedule, docs/mathematics.md section 2."""
    path = planned_paths(shipped("demo"))["r1"]
    assert abs(path.steering_rad[1000]) == pytest.approx(0.0655, abs=1e-4)


def test_landmarks_all_on_the_line_ahead_leave_the_place_along_it_unknown() -> None:
    fleet = straight("demo", 12.0)
    ahead = [Marker(id=100 + n, x_m=20.0 + 5 * n, y_m=20.0 + 5 * n) for n in range(3)]
    fleet = _with_robot(
        fleet, "r1", start=fleet.robots["r1"].start.model_copy(update={"heading_rad": 0.78539816})
    )
    (error,) = _errors(_report(fleet.model_copy(update={"landmarks": ahead})), "landmarks")
    assert "position along the line to landmark 10" in error
    assert "unbounded" in error
    assert "add or move landmarks" in error


def test_one_landmark_is_too_few_to_arm_and_to_drive() -> None:
    fleet = shipped("demo")
    report = _report(fleet.model_copy(update={"landmarks": fleet.landmarks[:1]}))
    assert _errors(report, "start")
    (error,) = _errors(report, "landmarks")
    assert "heading about landmark 101" in error


def test_two_landmarks_are_enough() -> None:
    fleet = shipped("demo")
    assert _report(fleet.model_copy(update={"landmarks": fleet.landmarks[:2]})).ok


def test_a_narrow_field_of_view_loses_the_landmarks_on_its_way() -> None:
    report = _report(_every(shipped("demo"), "bearing_sensor", fov_half_rad=0.6))
    assert not report.ok
    assert report.robots["r1"].least_seen < 2


def test_a_circle_too_tight_for_the_follower_inside_is_found_before_it_is_driven() -> None:
    report = _report(_circle(0.5, -1.0))
    assert any("r2" in error for error in _errors(report, "circle"))
    mirrored = _report(_circle(0.5, 1.0))
    assert not _errors(mirrored, "circle"), "the same circle to the left has the robots outside"


def test_a_circle_too_tight_for_the_leader_itself() -> None:
    (error,) = _errors(_report(_circle(0.2, 1.0)), "circle")
    assert error.startswith("error: r1, 0.0 to 5.0 s: radius of the front wheel's circle")


@pytest.mark.parametrize(("rate_radps", "feasible"), [(-1.1, True), (-1.15, False), (-1.8, False)])
def test_the_polar_law_needs_a_leader_point_within_the_turning_radius(
    rate_radps: float, feasible: bool
) -> None:
    """sqrt(R^2 - L^2) - rho sin(phi) >= d/tan(delta_max), so R >= 0.889 m; none below R = L."""
    fleet = _every(_circle(1.0, rate_radps), "formation", law="polar")
    fleet = fleet.model_copy(update={"robots": {n: fleet.robots[n] for n in ("r1", "r2")}})
    assert (not _errors(_report(fleet), "circle")) is feasible


def test_a_steering_limit_below_the_need_is_an_error() -> None:
    report = _report(_every(_circle(1.0, -0.2618), "limits", steering_rad=0.05))
    assert _errors(report, "steering_angle")
    assert _errors(report, "circle")
    assert _report(_every(_circle(1.0, -0.2618), "limits", steering_rad=0.1)).ok


def test_a_speed_limit_below_the_schedule_is_an_error() -> None:
    fleet = _every(straight("demo", 3.0), "limits", speed_mps=0.9)
    (error,) = _errors(_report(fleet), "speed")
    assert "1 m/s, limit 0.9 m/s" in error


def test_slow_steering_with_a_high_gain_is_unstable() -> None:
    fleet = shipped("paper")
    slow = fleet.simulation.steering.model_copy(update={"lag_s": 0.4})
    simulation = fleet.simulation.model_copy(update={"steering": slow})
    report = _report(fleet.model_copy(update={"simulation": simulation}))
    assert all("unstable" in error for error in _errors(report, "steering_loop"))
    assert len(_errors(report, "steering_loop")) == 2


def test_a_follower_directly_behind_needs_a_marker_off_the_axis() -> None:
    fleet = straight("demo", 12.0)
    behind = fleet.robots["r2"].offset
    assert behind is not None
    fleet = _with_robot(fleet, "r2", offset=behind.model_copy(update={"x_m": -0.45, "y_m": 0.0}))
    (error,) = _errors(_report(fleet), "range")
    assert error.startswith("error: r2")
    assert "range to r1: unbounded" in error
    side = [*fleet.robots["r1"].markers, Marker(id=13, x_m=-0.1, y_m=0.15)]
    assert not _errors(_report(_with_robot(fleet, "r1", markers=side)), "range")


def test_a_bad_mission_ends_with_code_1_a_report_and_a_map(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    fleet = _every(_circle(1.0, -0.2618), "limits", steering_rad=0.05)
    bad.write_text(dump_effective(fleet))
    out = tmp_path / "out"
    result = CliRunner().invoke(
        app, ["doctor", "--mission", "--fleet", str(bad), "--out", str(out), "--json"]
    )
    assert result.exit_code == NOT_GOOD
    report = json.loads(result.stdout)
    assert not report["ok"]
    assert {"robot", "from_s", "to_s", "value", "limit", "advice"} <= set(report["findings"][0])
    assert json.loads((out / "mission.json").read_text()) == report
    assert (out / "mission.png").read_bytes().startswith(b"\x89PNG")


def test_a_good_mission_ends_with_code_0(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["doctor", "--mission", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert "mission: good" in result.stdout
    assert "r2: weakest at" in result.stdout


def test_help_shows_an_example() -> None:
    result = CliRunner().invoke(app, ["doctor", "--help"])
    assert "Example: echelon doctor --mission" in result.stdout


def test_the_doctor_asks_what_to_examine() -> None:
    result = CliRunner().invoke(app, ["doctor"])
    assert result.exit_code == UNUSABLE
    assert "--mission" in result.stderr
