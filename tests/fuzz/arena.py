"""A running robot under fuzz: its bus and link are dirty, its guard and the truth are watched."""

import math
from collections import Counter
from collections.abc import Iterable
from itertools import chain
from typing import Any
from unittest.mock import patch

import can
import numpy as np

from config import topics
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.odrive import AxisState
from config.messages import CommandReply
from groundstation.formation_tree import start_order
from groundstation.lockstep import START_S, WALL_OFFSET_S, Lockstep
from onboard import link as link_module
from onboard.canbus.port import CanPort
from onboard.link import Link
from sim_hw.simcan.direct import Devices, DirectBus
from tests.fuzz.fake_zenoh import FakeQuery, FakeSample, FakeSession
from tests.fuzz.frames import FrameFuzzer
from tests.hil.fleets import carry_back
from tests.soak.fleet import circling
from tests.soak.operator import POWERED

STANDING_MPS = 0.02
COAST_S = 2.5
"""From a state with power to one without, a robot needs no longer to stand on truth."""
RECOVERY_S, PATIENCE_S = 30.0, 15.0
MOVING = ("RUNNING", "STOPPING")
LIMIT_SLACK = 1.001
RESTARTED = 0x100
"""Error class of a controller that is back, as the kernel numbers it."""


class Violation(AssertionError):
    """The robot did what it must never do."""


class DirtyBus(DirectBus):
    """The robot's end of the bus, with messages on it that no device has sent."""

    def __init__(self, devices: Devices, name: str) -> None:
        super().__init__(devices, name, START_S, WALL_OFFSET_S)
        self.dirt: list[can.Message] = []
        self.sent: list[can.Message] = []
        self.seen: list[can.Message] = []

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """A real message, then a dirty one, and so on."""
        if self.dirt and len(self.dirt) % 2:
            return self.dirt.pop()
        message = super().recv(timeout)
        if message is not None:
            self.seen.append(message)
            if not self.dirt:
                return message
            self.dirt.insert(0, message)
        return self.dirt.pop() if self.dirt else None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send, and remember."""
        super().send(msg, timeout)
        self.sent.append(msg)


class Arena:
    """Two robots in lockstep, of which one is attacked. `counts` are by state of the robot."""

    def __init__(self, target: str, seed: int) -> None:
        fleet = circling()
        self.lockstep = Lockstep(fleet, seed)
        self.rng = np.random.default_rng(seed)
        self.target = target
        self.counts: Counter[str] = Counter()
        self.stops: Counter[str] = Counter()
        self._order = start_order(fleet)
        self._settings = fleet.robots[target]
        self._at_rest_since_s = 0.0
        database = CanDatabase.load()
        self._set_up_bus(database)
        self._set_up_link()
        self._watch_guard()
        self._speed = database.axis(self._settings.vehicle.drive.node).set_input_vel
        self._states = {
            database.axis(axis.node).set_axis_state.can_id
            for axis in (self._settings.vehicle.steering, self._settings.vehicle.drive)
        }

    def _set_up_bus(self, database: CanDatabase) -> None:
        station, settings = self.lockstep.stations[self.target], self._settings
        self.bus = DirtyBus(self.lockstep.simulation.robots[self.target], self.target)
        station.port.close()
        station.host_bus, station.port = self.bus, CanPort(self.bus, settings.can.bitrate)
        drives = (settings.vehicle.steering, settings.vehicle.drive)
        axes = [database.axis(axis.node) for axis in drives]
        signed = [*database.bearing_sensor(settings.bearing_sensor.unit), *database.vehicle_aux()]
        self.fuzzer = FrameFuzzer(
            self.rng,
            [codec.can_id for codec in (*chain.from_iterable(axes), *signed)],
            {codec.can_id for axis in axes for codec in axis},
            {codec.can_id for codec in signed if codec.e2e_data_id is not None},
        )

    def _set_up_link(self) -> None:
        self.session = FakeSession(depth=64)
        with patch.object(link_module, "_open", lambda _fleet, _name: self.session):
            self.link = Link(self.lockstep.fleet, self.target)

    def _watch_guard(self) -> None:
        """Note every frame that the transmit guard lets pass."""
        guard: Any = self.lockstep.stations[self.target].robot._guard
        admit, self._admitted = guard.admit, list[Frame]()

        def watched(frames: Iterable[Frame]) -> list[Frame]:
            passed: list[Frame] = admit(frames)
            self._admitted += passed
            return passed

        guard.admit = watched

    @property
    def state(self) -> str:
        """State of the attacked robot."""
        return str(self.lockstep.stations[self.target].robot.state)

    @property
    def wall_s(self) -> float:
        """Wall clock of the run."""
        return self.lockstep.now_s + WALL_OFFSET_S

    def close(self) -> None:
        """Leave the buses."""
        self.lockstep.__exit__(None, None, None)

    def tick(self) -> None:
        """One cycle, and everything that must hold in it."""
        self._hear()
        before = self.state
        self.lockstep.tick()
        for message in self.bus.seen:
            self.fuzzer.show(message)
        self.bus.seen.clear()
        self._check_sent()
        self._check_truth(before)

    def attack_bus(self, count: int, quiet: bool) -> None:
        """One cycle with so many dirty messages on the bus."""
        self.counts[self.state] += count
        self.bus.dirt += self.fuzzer.burst(count, self.wall_s, quiet)
        self.tick()

    def attack_link(self, payloads: Iterable[tuple[str, bytes]]) -> None:
        """One cycle with these payloads, by topic, in the link."""
        fleet, name = self.lockstep.fleet.name, self.target
        leader = self._settings.leader or name
        keys = {
            "motion": topics.MOTION.key(fleet, leader),
            "estop": topics.ESTOP.key(fleet),
            "ground": topics.GROUND.key(fleet),
        }
        for topic, payload in payloads:
            self.counts[self.state] += 1
            if topic == "command":
                key = topics.COMMAND.key(fleet, name)
                self.session.queryables[key].handler.items.append(FakeQuery(payload))
            else:
                sample = FakeSample(keys[topic], payload)
                self.session.subscribers[keys[topic]].handler.items.append(sample)
        self.tick()

    def reach(self, wanted: str) -> bool:
        """Bring the fleet into a state by the operator's commands; False where it fails.

        After a while the operator also carries robots back that have lost their way.
        """
        lockstep, carry_s = self.lockstep, self.lockstep.now_s + PATIENCE_S
        end_s = lockstep.now_s + RECOVERY_S
        while lockstep.now_s < end_s:
            if self._is(wanted):
                return True
            if lockstep.now_s > carry_s:
                carry_s = end_s
                carry_back(lockstep)
                self.counts["carried back"] += 1
            self._restart_controller()
            for name in self._order:
                self._order_one(name, wanted)
            self.run_for(0.3)
        return False

    def _restart_controller(self) -> None:
        """What the operating system does after a bus-off that an error frame has announced."""
        status = self.lockstep.statuses.get(self.target)
        if status is not None and status.bus.state in ("passive", "bus-off"):
            self.bus.dirt.append(
                can.Message(
                    timestamp=self.wall_s,
                    arbitration_id=RESTARTED,
                    is_extended_id=False,
                    is_error_frame=True,
                )
            )

    def _is(self, wanted: str) -> bool:
        states = {str(station.robot.state) for station in self.lockstep.stations.values()}
        return states == {wanted} and (wanted != "STANDBY" or self._all_ready())

    def _all_ready(self) -> bool:
        statuses = self.lockstep.statuses.values()
        return len(statuses) == len(self._order) and all(status.ready for status in statuses)

    def _order_one(self, name: str, wanted: str) -> None:
        state = str(self.lockstep.stations[name].robot.state)
        ready = name in self.lockstep.statuses and self.lockstep.statuses[name].ready
        if state in ("FAULT", "ESTOP") or (state == "STANDBY" and not ready):
            self.command(name, "reset")
        elif wanted == "STANDBY" or (wanted == "ARMED" and state == "RUNNING"):
            if state != "STANDBY":
                self.command(name, "stop")
        elif state == "STANDBY" and self._all_ready():
            self.command(name, "arm")
        elif state == "ARMED" and wanted == "RUNNING":
            self.command(name, "start")

    def command(self, name: str, command: str) -> CommandReply:
        """Send a command; the cycles until its answer are watched like others."""
        return self.lockstep.command(name, command)

    def run_for(self, seconds: float) -> None:
        """Cycles without an attack."""
        end_s = self.lockstep.now_s + seconds
        while self.lockstep.now_s < end_s:
            self.tick()

    def _hear(self) -> None:
        """What the shell's loop does: poll the link."""
        station, link = self.lockstep.stations[self.target], self.link
        station.mail += link.motions()
        station.estops += link.estops()
        station.grounds += link.grounds()
        station.requests += link.requests()
        self.counts["unreadable"] += len(link.unreadable())

    def _check_sent(self) -> None:
        sent, self.bus.sent = self.bus.sent, []
        passed = [(frame.can_id, frame.data) for frame in self._admitted]
        self._admitted.clear()
        left = [(message.arbitration_id, bytes(message.data)) for message in sent]
        for each in left:
            if each not in passed:
                raise Violation(f"frame 0x{each[0]:03X} left without having passed the guard")
        per_m = self._settings.vehicle.drive.revolutions_per_unit
        for can_id, data in left:
            if can_id == self._speed.can_id:
                self._check_speed(self._speed.unpack(data).input_vel / per_m)
            closes = can_id in self._states and data[0] == AxisState.CLOSED_LOOP_CONTROL
            if closes and self.state not in POWERED:
                raise Violation(f"closed-loop control asked for in {self.state}")

    def _check_speed(self, speed_mps: float) -> None:
        limit_mps = self._settings.limits.speed_mps * LIMIT_SLACK if self.state in MOVING else 0.0
        if not math.isfinite(speed_mps) or abs(speed_mps) > limit_mps:
            raise Violation(f"speed setpoint {speed_mps} m/s in {self.state}, limit {limit_mps}")

    def _check_truth(self, before: str) -> None:
        now_s = self.lockstep.now_s
        if self.state in MOVING:
            self._at_rest_since_s = now_s
        if self.state == "RUNNING" or now_s - self._at_rest_since_s < COAST_S:
            return
        speed_mps = self.lockstep.simulation.robots[self.target].truth.speed_mps
        if abs(speed_mps) > STANDING_MPS:
            raise Violation(f"{self.target} moves at {speed_mps:.3f} m/s in {self.state}")
        if before == "STOPPING" and now_s - self._at_rest_since_s > COAST_S:
            raise Violation("still STOPPING")
