"""The whole fleet in one process under virtual time: same robots, buses, devices and messages.

Nothing here waits or reads a clock, so a run depends on the fleet file and the seed alone.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence

import msgspec
import numpy as np

from config import topics
from config.can.database import CanDatabase
from config.closing import Closing
from config.faults import FaultScript
from config.fleet import Fleet
from config.messages import (
    Command,
    CommandReply,
    Estop,
    Ground,
    LoopHealth,
    Motion,
    Status,
    Truth,
    encode,
)
from config.topics import Topic
from groundstation.formation_tree import start_order
from onboard.canbus.bus_errors import BusUnavailable
from onboard.canbus.port import CanPort
from onboard.robot import Robot
from onboard.step import Inputs, Request
from onboard.step_record import StepRecorder
from sim_hw.dataset.devices import PlaybackRobot
from sim_hw.dataset.mrclam import DataSetError, Recording, read_recording, robots_in
from sim_hw.fleet import SimulatedFleet
from sim_hw.simcan.direct import Devices, DirectBus

__all__ = [
    "DataSetError",
    "Lockstep",
    "LockstepFailed",
    "PlaybackLockstep",
    "Recording",
    "read_recording",
    "robots_in",
    "run_lockstep",
]

Record = Callable[[str, bytes, int], None]

# Virtual time starts here; the wall clock of a lockstep run starts at the epoch plus this offset.
START_S = 10.0
WALL_OFFSET_S = 1_000_000_000.0
START_WALL_NS = round((START_S + WALL_OFFSET_S) * 1e9)
READY_LIMIT_S = 20.0
STOP_LIMIT_S = 10.0
COMMAND_LIMIT_S = 2.0
GROUND_TICKS = 10
AT_REST = frozenset({"STANDBY", "FAULT", "ESTOP"})


class LockstepFailed(Exception):
    """The fleet did not do what the mission needs; the text names the robot and its reason."""


class Station:
    """One robot's computer: its `Robot`, and its port on the bus of emulated devices.

    `running` False is what a killed process looks like, `late_s` what a stalled one does,
    `ending` one that got SIGTERM, and `clock_step_s` one whose wall clock has been set.
    """

    def __init__(
        self,
        fleet: Fleet,
        name: str,
        devices: Devices,
        seed: int,
        db: CanDatabase,
        recorded: bool = False,
    ) -> None:
        self.robot = Robot(fleet, name, db, seed)
        self._record = StepRecorder(fleet, name, seed) if recorded else None
        self.host_bus = DirectBus(devices, name, START_S, WALL_OFFSET_S)
        self.port = CanPort(self.host_bus, fleet.robots[name].can.bitrate, self._reopen)
        self._devices, self._name = devices, name
        self.mail: list[Motion] = []
        self.requests: list[Request] = []
        self.estops: list[Estop] = []
        self.grounds: list[Ground] = []
        self.replies: dict[int, CommandReply] = {}
        self.running = True
        self.late_s = 0.0
        self.ending = False
        self.clock_step_s = 0.0

    def _reopen(self) -> DirectBus:
        """The same adapter once it is back."""
        if self._devices.adapter_lost:
            raise BusUnavailable("direct", self._name, "adapter gone", "Plug it in")
        bus = DirectBus(self._devices, self._name, START_S, WALL_OFFSET_S)
        self.host_bus = bus
        return bus

    def close(self) -> None:
        """Leave the bus."""
        self.port.close()

    def step(self, now_s: float, cycle: int) -> list[tuple[Topic, bytes]]:
        """One step of the robot; returns its messages as they are published."""
        wall_s = now_s + WALL_OFFSET_S + self.clock_step_s
        inputs = Inputs(
            now_s=now_s,
            wall_s=wall_s,
            frames=self.port.receive(now_s, wall_s),
            bus=self.port.health(),
            loop=LoopHealth(cycle, 0, 0.0, 0.0, 0.0, 0.0, realtime=True),
            late_s=self.late_s,
            motions=self.mail,
            requests=self.requests,
            estops=self.estops,
            grounds=self.grounds,
            shutdown=self.ending,
        )
        self.mail, self.requests, self.estops, self.grounds = [], [], [], []
        outputs = self.robot.step(inputs)
        self.port.send(outputs.frames)
        self.replies |= dict(outputs.replies)
        record = [] if self._record is None else self._record.messages(inputs, outputs)
        return [(topic, encode(message)) for topic, message in [*outputs.messages, *record]]


class Lockstep(Closing):
    """A fleet under virtual time, one tick of the control period at a time.

    `record` gets what is published; with `replayable` the record of every step too.
    """

    def __init__(
        self, fleet: Fleet, seed: int, record: Record | None = None, replayable: bool = False
    ) -> None:
        self.fleet = fleet
        self.now_s = START_S
        self.statuses: dict[str, Status] = {}
        self.simulation = SimulatedFleet(fleet, seed, START_S, CanDatabase.load())
        self.ground = True
        self._record = record
        self._ticks = 0
        self._numbers = itertools.count(1)
        self._truth_seq = 0
        database = CanDatabase.load()
        seeds = np.random.SeedSequence(seed).generate_state(len(fleet.robots))
        self.stations = {
            name: Station(
                fleet,
                name,
                self.simulation.robots[name],
                int(robot_seed),
                database,
                recorded=replayable,
            )
            for name, robot_seed in zip(fleet.robots, seeds, strict=True)
        }
        rates = {robot.loop.rate_hz for robot in fleet.robots.values()}
        self.period_s = 1.0 / max(rates)

    def close(self) -> None:
        """Leave all buses."""
        for station in self.stations.values():
            station.close()

    def tick(self) -> None:
        """Advance everything by one control period."""
        self._ticks += 1
        self.now_s = START_S + self._ticks * self.period_s
        self.simulation.advance(self.now_s)
        self._publish_truth()
        if self.ground and self._ticks % GROUND_TICKS == 0:
            self._beat()
        sent: list[tuple[Topic, str, bytes]] = []
        for name, station in self.stations.items():
            station.host_bus.update(self.now_s)
            if station.running:
                messages = station.step(self.now_s, self._ticks)
                sent += [(topic, name, body) for topic, body in messages]
        for topic, name, body in sent:
            self._deliver(topic, name, body)

    def run_until(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Tick until the condition holds; False when `limit_s` of virtual time passed before."""
        end_s = self.now_s + limit_s
        while not condition():
            if self.now_s >= end_s:
                return False
            self.tick()
        return True

    def run_for(self, seconds: float) -> None:
        """Tick for so long."""
        self.run_until(lambda: False, seconds)

    def command(
        self, name: str, command: str, override: Sequence[str] = (), formation: str = ""
    ) -> CommandReply:
        """Send an operator's command and tick until it is answered."""
        number = next(self._numbers)
        station = self.stations[name]
        wanted = Command(
            name=command, operator="lockstep", override=list(override), formation=formation
        )
        station.requests.append(Request(number, wanted))
        if not self.run_until(lambda: number in station.replies, 1.0):
            return CommandReply(robot=name, accepted=False, reason="no reply within 1 s")
        return station.replies.pop(number)

    def estop(self) -> None:
        """Publish one emergency stop."""
        stop = Estop(seq=0, t_ns=self._nanoseconds(), wall_ns=self._wall_ns(), operator="lockstep")
        self._put(topics.ESTOP.key(self.fleet.name), encode(stop))
        for station in self.stations.values():
            station.estops.append(stop)

    @property
    def at_rest(self) -> bool:
        """True where every robot that runs says that its drives are not powered."""
        return all(
            status.state in AT_REST
            for name, status in self.statuses.items()
            if self.stations[name].running
        )

    def start_mission(self) -> None:
        """Wait until all are ready, arm all, start all, followers first.

        Raises:
            LockstepFailed: a robot does not become ready, refuses, or does not get there.
        """
        if not self.run_until(self._all_ready, READY_LIMIT_S):
            waiting = "; ".join(
                f"{name}: {', '.join(status.not_ready)}"
                for name, status in self.statuses.items()
                if not status.ready
            )
            raise LockstepFailed(f"not ready within {READY_LIMIT_S:.0f} s: {waiting}")
        self._order("arm", "ARMED")
        self._order("start", "RUNNING")

    def _all_ready(self) -> bool:
        statuses = self.statuses
        return len(statuses) == len(self.stations) and all(s.ready for s in statuses.values())

    def _order(self, command: str, state: str) -> None:
        for name in start_order(self.fleet):
            reply = self.command(name, command)
            if not reply.accepted:
                raise LockstepFailed(f"{name} refuses to {command}: {reply.reason}")
        if not self.run_until(
            lambda: {status.state for status in self.statuses.values()} == {state}, COMMAND_LIMIT_S
        ):
            states = {name: status.state for name, status in self.statuses.items()}
            raise LockstepFailed(f"not all {state} within {COMMAND_LIMIT_S:.0f} s: {states}")

    def _nanoseconds(self) -> int:
        return round(self.now_s * 1e9)

    def _wall_ns(self) -> int:
        return round((self.now_s + WALL_OFFSET_S) * 1e9)

    def _put(self, key: str, body: bytes) -> None:
        if self._record is not None:
            self._record(key, body, self._wall_ns())

    def _beat(self) -> None:
        """The ground station's heartbeat."""
        t_ns, wall_ns = self._nanoseconds(), self._wall_ns()
        beat = Ground(seq=self._ticks, t_ns=t_ns, wall_ns=wall_ns, operator="lockstep")
        for station in self.stations.values():
            station.grounds.append(beat)

    def _publish_truth(self) -> None:
        self._truth_seq += 1
        for name, simulated in self.simulation.robots.items():
            truth = simulated.truth
            message = Truth(
                seq=self._truth_seq,
                t_ns=self._nanoseconds(),
                wall_ns=self._wall_ns(),
                robot=name,
                x_m=truth.x_m,
                y_m=truth.y_m,
                heading_rad=truth.heading_rad,
                steering_rad=truth.steering_rad,
                speed_mps=truth.speed_mps,
            )
            self._put(topics.TRUTH.key(self.fleet.name, name), encode(message))

    def _deliver(self, topic: Topic, name: str, body: bytes) -> None:
        """What Zenoh does: to the recorder, to the followers and to the operator."""
        self._put(topic.key(self.fleet.name, name), body)
        if topic is topics.MOTION:
            for follower in self.fleet.followers_of(name):
                self.stations[follower].mail.append(msgspec.json.decode(body, type=Motion))
        elif topic is topics.STATUS:
            self.statuses[name] = msgspec.json.decode(body, type=Status)


def run_lockstep(
    fleet: Fleet,
    seed: int,
    record: Record,
    progress: Callable[[float], None] | None = None,
    script: FaultScript | None = None,
    replayable: bool = False,
) -> None:
    """Drive the fleet's mission from standing still to standing still.

    `progress` is told the mission time [s] about once a second of virtual time; `script` holds
    faults of the emulated hardware; `replayable` as in `Lockstep`.

    Raises:
        LockstepFailed: a robot does not become ready or refuses a command.
    """
    with Lockstep(fleet, seed, record, replayable) as lockstep:
        if script is not None:
            lockstep.simulation.play(script)
        lockstep.start_mission()
        limit_s = fleet.mission.duration_s + STOP_LIMIT_S
        end_s = lockstep.now_s + limit_s
        while lockstep.now_s < end_s and not lockstep.at_rest:
            lockstep.run_for(1.0)
            if progress is not None:
                progress(max(0.0, limit_s - (end_s - lockstep.now_s)))


class PlaybackLockstep(Closing):
    """Robots on recorded devices under virtual time; `hear` gets every message they publish.

    They are never armed: what they do is estimate. `recordings` are by the robots' names.
    """

    def __init__(
        self,
        fleet: Fleet,
        recordings: Mapping[str, Recording],
        seed: int,
        hear: Callable[[Topic, str, bytes], None],
    ) -> None:
        self.now_s = START_S
        self._fleet, self._hear = fleet, hear
        database = CanDatabase.load()
        self.devices = {
            name: PlaybackRobot(fleet.robots[name], recording, database, START_S)
            for name, recording in recordings.items()
        }
        self._stations = {
            name: Station(fleet, name, self.devices[name], seed, database) for name in recordings
        }
        self._period_s = 1.0 / max(fleet.robots[name].loop.rate_hz for name in recordings)
        self._ticks = 0

    @property
    def played_s(self) -> float:
        """How far the recordings have been played."""
        started_s = next(iter(self.devices.values())).started_s
        return 0.0 if started_s is None else self.now_s - started_s

    @property
    def ended(self) -> bool:
        """One of the recordings is over."""
        return any(devices.ended for devices in self.devices.values())

    def close(self) -> None:
        """Leave all buses."""
        for station in self._stations.values():
            station.close()

    def tick(self) -> None:
        """Advance everything by one control period."""
        self._ticks += 1
        self.now_s = START_S + self._ticks * self._period_s
        sent: list[tuple[Topic, str, bytes]] = []
        for name, station in self._stations.items():
            self.devices[name].advance(self.now_s)
            station.host_bus.update(self.now_s)
            sent += [(topic, name, body) for topic, body in station.step(self.now_s, self._ticks)]
        for topic, name, body in sent:
            self._hear(topic, name, body)
            if topic is topics.MOTION:
                for follower in self._fleet.followers_of(name):
                    self._stations[follower].mail.append(msgspec.json.decode(body, type=Motion))
