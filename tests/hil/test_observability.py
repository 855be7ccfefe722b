"""A leader that loses its landmarks: refused before it moves, stopped when it moves on."""

from config.fleet import Fleet, Marker
from tests.hil.clean import standing
from tests.hil.fleets import powered_up, straight

NEAR = [(-2.0, -2.0), (-2.0, 2.0), (2.0, -2.0)]
FAR = [(5.0, 1.0), (9.0, 5.0), (12.0, 8.0), (16.0, 12.0)]


def _leader_alone(places: list[tuple[float, float]]) -> Fleet:
    """The demo's leader on a straight at 45 deg, landmarks seen up to 6 m."""
    fleet = straight("demo", 60.0)
    sensor = fleet.simulation.bearings.model_copy(update={"range_m": 6.0})
    return fleet.model_copy(
        update={
            "robots": {"r1": fleet.robots["r1"]},
            "landmarks": [Marker(id=101 + n, x_m=x, y_m=y) for n, (x, y) in enumerate(places)],
            "simulation": fleet.simulation.model_copy(update={"bearings": sensor}),
        }
    )


def test_with_one_landmark_in_view_the_leader_refuses_to_arm_and_names_what_is_lost() -> None:
    with powered_up(_leader_alone(NEAR[:1]), 1) as lockstep:
        lockstep.run_for(1.0)
        reply = lockstep.command("r1", "arm")
    assert not reply.accepted
    assert "heading about landmark 101" in reply.reason


def test_with_an_empty_map_the_leader_drives_by_odometry_alone() -> None:
    with powered_up(_leader_alone([]), 1) as lockstep:
        lockstep.start_mission()
        lockstep.run_for(6.0)
        assert lockstep.statuses["r1"].state == "RUNNING"


def test_driving_on_with_a_single_landmark_ends_in_a_controlled_stop_with_the_reason() -> None:
    with powered_up(_leader_alone([*NEAR, *FAR[::2]]), 1) as lockstep:
        lockstep.start_mission()
        assert lockstep.run_until(lambda: lockstep.at_rest, 30.0)
        assert lockstep.statuses["r1"].state == "STANDBY"
        assert "unobservable for 5" in lockstep.statuses["r1"].reason
        assert "heading about landmark 10" in lockstep.statuses["r1"].reason
        assert standing(lockstep, "r1")
