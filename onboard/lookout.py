"""Gathers once per cycle what the safety checks look at: the robot's `Observations`."""

from collections import deque

from config.fleet import Robot
from onboard.canbus.port import BusState
from onboard.hardware import Hardware, drive_seen
from onboard.role import Observation, Role, Stamp
from onboard.safety.clock_watch import ClockWatch
from onboard.safety.observations import LeaderSeen, Observations
from onboard.safety.repeat_watch import RepeatWatch
from onboard.safety.states import State
from onboard.step import Inputs

ARRIVALS = 100
"""The youngest of the leader's last messages tells how far the two wall clocks differ."""
RATE_WINDOW_S = 1.0


class Lookout:
    """Remembers what has to be compared from cycle to cycle."""

    def __init__(self, settings: Robot, role: Role, hardware: Hardware) -> None:
        self._role, self._hardware = role, hardware
        self._leader_name = settings.leader
        self._clock = ClockWatch(settings.failsafe.clock_step.limit_s)
        self._repeats = RepeatWatch()
        self._bearing_s: float | None = None
        self._looks_s: deque[float] = deque()
        self._first_s: float | None = None
        self._ground_s = float("-inf")
        self._arrival_ages_s: deque[float] = deque(maxlen=ARRIVALS)
        self._send_failures = 0
        self._ending = False

    def look(
        self, at: Stamp, inputs: Inputs, observations: list[Observation], state: State
    ) -> Observations:
        """One look. Drives and encoder are compared once arming has aligned them."""
        hardware, now_s = self._hardware, at.now_s
        dropped, self._send_failures = (
            inputs.bus.send_failures - self._send_failures,
            inputs.bus.send_failures,
        )
        if inputs.grounds:
            self._ground_s = now_s
        self._ending = self._ending or inputs.shutdown
        return Observations(
            state=state,
            leader=self._leader(at, inputs),
            bearing_age_s=self._bearing_age_s(now_s, observations),
            bearing_problem=hardware.sensor.problem(now_s),
            bearing_rate_hz=self._bearing_rate_hz(now_s),
            bearings_repeat_s=self._repeats.look(now_s, observations, hardware.speed_mps),
            estimate=self._role.estimate_seen(at),
            drive=drive_seen(hardware.drive, now_s),
            steering=drive_seen(hardware.steering, now_s),
            encoder_age_s=hardware.encoder.stale_for(now_s),
            encoder_problem=hardware.encoder.complaint,
            steering_rad=hardware.encoder.angle_rad,
            disagreement_rad=hardware.steering_disagreement_rad() if state in POWERED else None,
            speed_response=hardware.speed_response(),
            steering_response=hardware.steering_response(),
            bus_state=BusState(inputs.bus.state),
            bus_reason=inputs.bus.reason,
            bus_load=inputs.bus.load,
            frames_dropped=max(0, dropped),
            loop_late_s=inputs.late_s,
            clock_step_s=self._clock.step_s(now_s, at.wall_s),
            ground_age_s=now_s - self._ground_s,
            safety_node=hardware.safety_node.seen(now_s),
            realtime=inputs.loop.realtime,
            free_disk_mb=inputs.free_disk_mb,
            ending=self._ending,
            estop_by=inputs.estops[-1].operator if inputs.estops else None,
        )

    def _leader(self, at: Stamp, inputs: Inputs) -> LeaderSeen | None:
        leader = self._role.leader_seen(at)
        if leader is None:
            return None
        self._arrival_ages_s.extend(
            at.wall_s - motion.wall_ns * 1e-9
            for motion in inputs.motions
            if motion.robot == self._leader_name
        )
        offset_s = min(self._arrival_ages_s) if self._arrival_ages_s else None
        return LeaderSeen(leader.name, leader.age_s, leader.state, leader.problem, offset_s)

    def _bearing_age_s(self, now_s: float, observations: list[Observation]) -> float | None:
        if not self._role.lives_on_bearings:
            return 0.0
        watched = [seen.age_s for seen in observations if self._role.watches(seen.marker)]
        if watched:
            self._bearing_s = now_s - min(watched)
        return None if self._bearing_s is None else now_s - self._bearing_s

    def _bearing_rate_hz(self, now_s: float) -> float | None:
        """Looks per second, None until the window is full."""
        if self._first_s is None:
            self._first_s = now_s
        self._looks_s.extend([now_s] * self._hardware.looks)
        while self._looks_s and now_s - self._looks_s[0] > RATE_WINDOW_S:
            self._looks_s.popleft()
        full = now_s - self._first_s >= RATE_WINDOW_S
        return len(self._looks_s) / RATE_WINDOW_S if full else None


POWERED = (State.ARMING, State.ARMED, State.RUNNING, State.STOPPING)
