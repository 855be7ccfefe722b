"""From what any robot notices to the frames on its bus: within one cycle, to the tick."""

from collections.abc import Iterable

import pytest

from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.vehicle import SafetyStatus
from config.faults import Fault
from config.messages import Estop
from groundstation.lockstep import Lockstep
from sim_hw.protected import ProtectedSender
from tests.hil.fleets import driving, straight

DEMO = straight("demo", 60.0)
NAMES = ("r1", "r2", "r3")


def sent_in_next_cycle(lockstep: Lockstep, name: str) -> list[Frame]:
    """What a robot sends in the cycle that follows."""
    station, sent = lockstep.stations[name], list[Frame]()
    send = station.port.send

    def watched(frames: Iterable[Frame]) -> int:
        made = list(frames)
        sent.extend(made)
        return send(made)

    station.port.send = watched  # type: ignore[method-assign]
    lockstep.tick()
    station.port.send = send  # type: ignore[method-assign]
    return sent


def estop_ids(lockstep: Lockstep, name: str) -> set[int]:
    vehicle = lockstep.fleet.robots[name].vehicle
    database = CanDatabase.load()
    return {database.axis(axis.node).estop.can_id for axis in (vehicle.steering, vehicle.drive)}


@pytest.mark.parametrize("name", NAMES)
def test_an_emergency_stop_is_on_the_bus_in_the_cycle_that_hears_it(name: str) -> None:
    with driving(DEMO, broken=(name,)) as lockstep:
        stop = Estop(seq=1, t_ns=0, wall_ns=0, operator="test")
        lockstep.stations[name].estops.append(stop)
        sent = {frame.can_id for frame in sent_in_next_cycle(lockstep, name)}
        assert estop_ids(lockstep, name) <= sent


@pytest.mark.parametrize("name", NAMES)
def test_the_safety_nodes_button_is_on_the_bus_in_the_cycle_that_trusts_it(name: str) -> None:
    """Two good frames after the first make the node trusted; the button acts with the third."""
    codec = CanDatabase.load().vehicle_aux().safety_status
    fields = dict.fromkeys(SafetyStatus._fields, 0.0) | {"power_enabled": 1, "estop_button": 1}
    node = ProtectedSender(codec)
    with driving(DEMO, broken=(name,)) as lockstep:
        for cycle in range(3):
            frame = node.frame(lockstep.now_s, tuple(fields[name] for name in SafetyStatus._fields))
            lockstep.simulation.robots[name].bus.to_host.append(frame)
            sent = {each.can_id for each in sent_in_next_cycle(lockstep, name)}
            assert (estop_ids(lockstep, name) <= sent) == (cycle == 2)


@pytest.mark.parametrize("name", NAMES)
def test_a_stop_of_its_own_begins_its_ramp_in_the_cycle_that_notices_it(name: str) -> None:
    with driving(DEMO) as lockstep:
        database, vehicle = CanDatabase.load(), lockstep.fleet.robots[name].vehicle
        codec = database.axis(vehicle.drive.node).set_input_vel

        def speed_in_next_cycle() -> float:
            sent = sent_in_next_cycle(lockstep, name)
            (frame,) = (frame for frame in sent if frame.can_id == codec.can_id)
            return codec.unpack(frame.data).input_vel / vehicle.drive.revolutions_per_unit

        before_mps = speed_in_next_cycle()
        lockstep.stations[name].late_s = 0.2
        ramp_mps = lockstep.fleet.robots[name].limits.deceleration_mps2 * lockstep.period_s
        assert speed_in_next_cycle() == pytest.approx(before_mps - ramp_mps, abs=0.2 * ramp_mps)


def test_a_wheel_that_never_says_that_it_stands_is_a_fault_when_the_stop_is_overdue() -> None:
    with driving(DEMO, broken=("r3",)) as lockstep:
        limits = lockstep.fleet.robots["r3"].limits
        due_s = limits.speed_mps / limits.deceleration_mps2 + 2.0
        lockstep.simulation.inject(Fault(robot="r3", device="drive", kind="stuck"))
        lockstep.tick()
        assert lockstep.command("r3", "stop").accepted
        began_s = lockstep.now_s
        assert lockstep.run_until(lambda: lockstep.statuses["r3"].state != "STOPPING", 6.0)
        assert lockstep.statuses["r3"].state == "FAULT"
        assert "not standing 2.5 s after" in lockstep.statuses["r3"].reason
        assert lockstep.now_s - began_s == pytest.approx(due_s, abs=0.05)
