"""Simulated hardware in real time: the fleet's buses, its truth, and the loop that drives them."""

import gc
import select
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import zenoh

from config import topics
from config.messages import SimulatedBus, Truth, encode
from sim_hw.fleet import SimulatedFleet
from sim_hw.live_faults import LiveFaults
from sim_hw.robot import SimulatedRobot
from sim_hw.simcan.server import SimCanServer
from sim_hw.timing import Cycle

PERIOD_S = 0.002
REPORT_LATE_S = 0.05
REPORT_EVERY_S = 10.0


class _Host:
    """One robot's devices and the socket that its host connects to."""

    def __init__(self, robot: SimulatedRobot, server: SimCanServer) -> None:
        self.robot = robot
        self.server = server
        self._full = False
        self._adapter = True

    def filenos(self) -> list[int]:
        return self.server.filenos() if self._adapter else []

    def deliver(self, t_s: float, wall_s: float) -> None:
        """Queue what the host has sent, and tell it whether there is room for more."""
        self._follow_adapter()
        if not self._adapter:
            return
        full = False
        for frame in self.server.receive(t_s, wall_s):
            full = not self.robot.deliver(frame)
        full = full or self.robot.bus.host_full
        if full is not self._full:
            self._full = full
            self.server.tell_queue(full)

    def send(self, t_s: float, wall_s: float) -> None:
        frames = self.robot.collect()
        if self._adapter:
            for frame in frames:
                self.server.send(frame, wall_s + frame.t_s - t_s)

    def _follow_adapter(self) -> None:
        if self.robot.adapter_lost is not self._adapter:
            return
        self._adapter = not self._adapter
        self._full = False
        if self._adapter:
            self.server.reopen()
        else:
            self.server.close()


class Buses:
    """The robots' devices joined to the sockets that their hosts connect to."""

    def __init__(self, fleet: SimulatedFleet, servers: Mapping[str, SimCanServer]) -> None:
        self._fleet = fleet
        self._hosts = [_Host(fleet.robots[name], server) for name, server in servers.items()]

    @property
    def dropped(self) -> int:
        """Frames lost so far to clients that do not read."""
        return sum(host.server.dropped for host in self._hosts)

    def listen_until(self, deadline_s: float) -> None:
        """Deliver the hosts' frames as they arrive, until a monotonic deadline."""
        while (remaining_s := deadline_s - time.monotonic()) > 0:
            filenos = [number for host in self._hosts for number in host.filenos()]
            if select.select(filenos, [], [], remaining_s)[0]:
                self.deliver(time.monotonic(), time.time())

    def deliver(self, t_s: float, wall_s: float) -> None:
        """Deliver what the hosts have sent to devices that have been moved on to now, `t_s`."""
        self._fleet.advance(t_s)
        for host in self._hosts:
            host.deliver(t_s, wall_s)

    def send(self, t_s: float, wall_s: float) -> None:
        """Put on the buses what the devices have sent; `t_s` and `wall_s` are one instant."""
        for host in self._hosts:
            host.send(t_s, wall_s)


class Publisher:
    """Publishes where the robots really are, and how their buses are, as `config.topics` says."""

    def __init__(
        self, session: zenoh.Session, fleet_name: str, robots: Mapping[str, SimulatedRobot]
    ) -> None:
        self._robots = robots
        self._sequence = 0
        self._publishers = {
            name: session.declare_publisher(topics.TRUTH.key(fleet_name, name)) for name in robots
        }
        self._bus_publishers = {
            name: session.declare_publisher(topics.SIM_BUS.key(fleet_name, name)) for name in robots
        }

    def publish(self, wall_minus_monotonic_s: float) -> None:
        """Publish every robot's truth, given the wall clock's lead over the monotonic clock.

        Every second, its bus too.
        """
        for name, robot in self._robots.items():
            message = truth_message(name, robot, self._sequence, wall_minus_monotonic_s)
            self._publishers[name].put(encode(message))
        if self._sequence % round(topics.TRUTH.rate_hz / topics.SIM_BUS.rate_hz) == 0:
            self._publish_buses(wall_minus_monotonic_s)
        self._sequence += 1

    def _publish_buses(self, wall_minus_monotonic_s: float) -> None:
        for name, robot in self._robots.items():
            message = bus_message(name, robot, self._sequence, wall_minus_monotonic_s)
            self._bus_publishers[name].put(encode(message))


def truth_message(
    name: str, robot: SimulatedRobot, sequence: int, wall_minus_monotonic_s: float
) -> Truth:
    """The truth of one robot as it is published."""
    truth = robot.truth
    return Truth(
        seq=sequence,
        t_ns=round(truth.t_s * 1e9),
        wall_ns=round((truth.t_s + wall_minus_monotonic_s) * 1e9),
        robot=name,
        x_m=truth.x_m,
        y_m=truth.y_m,
        heading_rad=truth.heading_rad,
        steering_rad=truth.steering_rad,
        speed_mps=truth.speed_mps,
    )


def bus_message(
    name: str, robot: SimulatedRobot, sequence: int, wall_minus_monotonic_s: float
) -> SimulatedBus:
    """The state of one robot's bus as it is published."""
    t_s, host, load = robot.truth.t_s, robot.bus.host, robot.bus.load
    return SimulatedBus(
        seq=sequence,
        t_ns=round(t_s * 1e9),
        wall_ns=round((t_s + wall_minus_monotonic_s) * 1e9),
        robot=name,
        load=load.share,
        frames=load.frames,
        errors=load.errors,
        host_state=host.state.name,
        transmit_errors=host.transmit_errors,
        receive_errors=host.receive_errors,
        host_overflowed=host.overflowed,
    )


@dataclass(slots=True)
class Lateness:
    """How well the loop has kept its schedule."""

    periods: int = 0
    skipped: int = 0
    worst_s: float = 0.0

    def record(self, late_s: float) -> int:
        """Count one period that began `late_s` late; returns how many must be skipped."""
        missed = max(0, int(late_s / PERIOD_S))
        self.periods += 1
        self.skipped += missed
        self.worst_s = max(self.worst_s, late_s)
        return missed

    def __str__(self) -> str:
        return (
            f"{self.periods} periods of {PERIOD_S * 1e3:g} ms, {self.skipped} skipped, "
            f"at worst {self.worst_s * 1e3:.1f} ms late"
        )


def run(
    buses: Buses,
    publisher: Publisher,
    live: LiveFaults,
    stopped: Callable[[], bool],
    say: Callable[[str], None],
) -> Lateness:
    """Drive the fleet in real time until `stopped`; `say` so when it falls behind, and faults."""
    gc.collect()
    gc.freeze()
    lateness = Lateness()
    next_s = time.monotonic() + PERIOD_S
    truth_cycle = Cycle(next_s, 1.0 / topics.TRUTH.rate_hz)
    quiet_until_s = 0.0
    while not stopped():
        buses.listen_until(next_s)
        t_s, wall_s = time.monotonic(), time.time()
        buses.deliver(t_s, wall_s)
        buses.send(t_s, wall_s)
        if truth_cycle.due(t_s):
            publisher.publish(wall_s - t_s)
            for note in live.poll():
                say(note)
        late_s = t_s - next_s
        next_s += PERIOD_S * (1 + lateness.record(late_s))
        if late_s > REPORT_LATE_S and t_s > quiet_until_s:
            say(f"{late_s * 1e3:.0f} ms late: this machine is too slow or too busy")
            quiet_until_s = t_s + REPORT_EVERY_S
    return lateness
