"""A robot's messages: sequence numbers, rates and the stamps of both clocks."""

from config import topics
from config.messages import (
    Bearings,
    BusHealth,
    DriveHealth,
    Event,
    Look,
    LoopHealth,
    Message,
    Motion,
    Observability,
    Particles,
    Sighting,
    Status,
)
from config.topics import Topic
from onboard.estimate.observability_monitor import ObservabilityMonitor
from onboard.role import Observation, Odometry, Role, Stamp

# A tick may come a little early; half a period of the fastest topic is slack enough.
RATE_SLACK_S = 0.002


class Telemetry:
    """Collects one step's messages; `take` hands them over."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._seq: dict[str, int] = {}
        self._next_s: dict[str, float] = {}
        self._out: list[tuple[Topic, Message]] = []
        self._at = Stamp(0.0, 0.0)
        self._degraded = False
        self._looks: dict[int, Look] = {}

    def begin(self, at: Stamp) -> None:
        """Messages made from now on are stamped with this instant."""
        self._at = at

    def take(self) -> list[tuple[Topic, Message]]:
        """The messages made since the last call."""
        out, self._out = self._out, []
        return out

    def event(self, severity: str, text: str) -> None:
        """Something that happened once; severity is "info", "warning" or "error"."""
        seq, t_ns, wall_ns = self._head(topics.EVENT)
        event = Event(
            seq=seq, t_ns=t_ns, wall_ns=wall_ns, source=self._name, severity=severity, text=text
        )
        self._out.append((topics.EVENT, event))

    def motion(
        self,
        state: str,
        reason: str,
        mission_time_s: float | None,
        odometry: Odometry | None,
        sightings: list[Sighting],
    ) -> None:
        """What followers need, every step. Not valid while the odometry is missing."""
        seq, t_ns, wall_ns = self._head(topics.MOTION)
        moving = odometry or Odometry(0.0, 0.0, 0.0)
        message = Motion(
            seq=seq,
            t_ns=t_ns,
            wall_ns=wall_ns,
            valid=odometry is not None,
            robot=self._name,
            state=state,
            reason=reason,
            mission_time_s=mission_time_s,
            speed_mps=moving.speed_mps,
            steering_rad=moving.steering_rad,
            sightings=sightings,
        )
        self._out.append((topics.MOTION, message))

    def estimate(self, role: Role) -> None:
        """The role's estimate at its topic's rate."""
        if not self._due(topics.POSE):
            return
        report = role.report(self._seq.get("estimate", 0), self._at)
        if report is not None:
            self._seq["estimate"] = self._seq.get("estimate", 0) + 1
            self._out.append(report)

    def observability(self, monitor: ObservabilityMonitor) -> None:
        """The monitor's finding at its topic's rate; an event where it begins to be a worry."""
        finding = monitor.finding
        if finding is None or not self._due(topics.OBSERVABILITY):
            return
        if monitor.degraded and not self._degraded:
            self.event("warning", f"weakly observable: {finding}")
        self._degraded = monitor.degraded
        seq, t_ns, wall_ns = self._head(topics.OBSERVABILITY)
        message = Observability(
            seq=seq,
            t_ns=t_ns,
            wall_ns=wall_ns,
            robot=self._name,
            source=finding.source,
            weak=finding.weak,
            direction=finding.direction,
            std_m=finding.std_m,
            limit_m=finding.limit_m,
            weak_for_s=monitor.weak_for_s,
            singular_value=finding.singular_value,
            landmarks=list(finding.landmarks),
            transverse_mps=finding.transverse_mps,
        )
        self._out.append((topics.OBSERVABILITY, message))

    def bearings(self, observations: list[Observation]) -> None:
        """The newest look at every marker since the last message, at the topic's rate."""
        for seen in observations:
            self._looks[seen.marker] = Look(seen.marker, seen.body_rad, seen.std_rad)
        if not self._due(topics.BEARINGS):
            return
        seq, t_ns, wall_ns = self._head(topics.BEARINGS)
        looks, self._looks = list(self._looks.values()), {}
        message = Bearings(seq=seq, t_ns=t_ns, wall_ns=wall_ns, robot=self._name, looks=looks)
        self._out.append((topics.BEARINGS, message))

    def particles(self, role: Role) -> None:
        """Some of the estimate's particles at the topic's rate, where it has any."""
        if not self._due(topics.PARTICLES) or not (found := role.particles()):
            return
        seq, t_ns, wall_ns = self._head(topics.PARTICLES)
        message = Particles(
            seq=seq,
            t_ns=t_ns,
            wall_ns=wall_ns,
            robot=self._name,
            x_m=[round(x_m, 4) for x_m, _ in found],
            y_m=[round(y_m, 4) for _, y_m in found],
        )
        self._out.append((topics.PARTICLES, message))

    def status(
        self,
        *,
        state: str,
        reason: str,
        not_ready: list[str],
        mission_time_s: float | None,
        loop: LoopHealth,
        bus: BusHealth,
        blocked_frames: int,
        steering: DriveHealth,
        drive: DriveHealth,
        formation: str,
        changed: bool,
    ) -> None:
        """State and health at the topic's rate, and at once when the state has changed."""
        if not self._due(topics.STATUS) and not changed:
            return
        seq, t_ns, wall_ns = self._head(topics.STATUS)
        message = Status(
            seq=seq,
            t_ns=t_ns,
            wall_ns=wall_ns,
            robot=self._name,
            state=state,
            reason=reason,
            ready=not not_ready,
            not_ready=not_ready,
            mission_time_s=mission_time_s,
            loop=loop,
            bus=bus,
            blocked_frames=blocked_frames,
            steering=steering,
            drive=drive,
            formation=formation,
        )
        self._out.append((topics.STATUS, message))

    def _head(self, topic: Topic) -> tuple[int, int, int]:
        seq = self._seq.get(topic.name, 0)
        self._seq[topic.name] = seq + 1
        return seq, round(self._at.now_s * 1e9), round(self._at.wall_s * 1e9)

    def _due(self, topic: Topic) -> bool:
        due_s = self._next_s.get(topic.name, self._at.now_s)
        if self._at.now_s < due_s - RATE_SLACK_S:
            return False
        self._next_s[topic.name] = max(due_s, self._at.now_s - 1.0) + 1.0 / topic.rate_hz
        return True
