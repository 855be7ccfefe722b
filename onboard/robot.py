"""One robot: `step` turns what came in during a cycle into what goes out. Pure: no clock, no IO.

The order within a step: take frames and messages in, estimate, look for reasons to stop, answer
the operator, drive, and let every frame pass the transmit guard. Everything that `step` depends
on is in `Inputs`, so the same inputs give the same outputs.
"""

from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.vehicle import EstopSource, HostState
from config.fleet import Fleet
from config.formations import formation_names
from config.messages import Sighting
from onboard.control.steering import WheelController
from onboard.follower import Follower
from onboard.hardware import Hardware, drive_health
from onboard.leader import Leader
from onboard.role import Observation, Odometry, Role, Stamp
from onboard.safety.states import State
from onboard.safety.transmit_guard import TransmitGuard
from onboard.step import Inputs, Outputs
from onboard.supervision import Supervision
from onboard.telemetry import Telemetry

# A late cycle integrates at most this far: the failsafe stops the robot long before.
MAX_STEP_S = 0.1
STANDING_MPS = 0.02

HOST_STATES = {
    State.STANDBY: HostState.READY,
    State.ARMING: HostState.ACTIVE,
    State.ARMED: HostState.ACTIVE,
    State.RUNNING: HostState.ACTIVE,
    State.STOPPING: HostState.STOPPING,
    State.FAULT: HostState.FAULT,
    State.ESTOP: HostState.FAULT,
}


class Robot:
    """A robot of the fleet, leader or follower, on the hardware that its fleet file names.

    `seed` is that of the particle filter.
    """

    def __init__(self, fleet: Fleet, name: str, database: CanDatabase, seed: int) -> None:
        settings = fleet.robots[name]
        self._role: Role = (
            Leader(fleet, name, seed) if settings.leader is None else Follower(fleet, name)
        )
        self._follower_of = {
            marker.id: follower
            for follower in fleet.followers_of(name)
            for marker in fleet.robots[follower].markers
        }
        self._hardware = Hardware(settings, database)
        self._wheels = WheelController(settings.limits)
        self._guard = TransmitGuard(
            database, settings.vehicle, settings.limits, settings.bearing_sensor.unit
        )
        self._telemetry = Telemetry(name)
        self._supervision = Supervision(
            name,
            settings,
            self._role,
            self._hardware,
            self._telemetry,
            formation_names(fleet),
        )
        self._last_s: float | None = None

    @property
    def state(self) -> State:
        """State of the state machine."""
        return self._supervision.state

    @property
    def finished(self) -> bool:
        """True once a shutdown was asked for and the drives are let go of."""
        return self._supervision.finished

    def step(self, inputs: Inputs) -> Outputs:
        """One cycle: from everything that came in to everything that goes out."""
        at = Stamp(inputs.now_s, inputs.wall_s)
        dt_s = 0.0 if self._last_s is None else inputs.now_s - self._last_s
        dt_s = min(max(dt_s, 0.0), MAX_STEP_S)
        self._last_s = inputs.now_s
        self._telemetry.begin(at)
        for text in [*inputs.unreadable, *inputs.notes]:
            self._telemetry.event("warning", text)
        for motion in inputs.motions:
            self._role.hear(at, motion)
        for frame in inputs.frames:
            self._guard.observe(frame)
        self._hardware.take(inputs.frames, dt_s)
        odometry = self._hardware.odometry(at.now_s)
        observations = self._hardware.observations(at.now_s)
        if odometry is not None:
            self._role.estimate(at, dt_s, odometry, observations)
        replies = self._supervision.step(at, inputs, odometry, observations)
        self._drive(dt_s, odometry)
        frames = self._frames(at.now_s)
        self._report(at, inputs, odometry, observations)
        return Outputs(frames, self._telemetry.take(), replies)

    def _drive(self, dt_s: float, odometry: Odometry | None) -> None:
        """Setpoints of this cycle; drives that get none hold still."""
        state = self._supervision.state
        if state is State.RUNNING and odometry is not None:
            self._hardware.command(self._role.drive(dt_s, self._wheels, odometry))
        elif state in (State.RUNNING, State.STOPPING):
            self._hardware.command(self._wheels.stop(dt_s))
            if state is State.STOPPING and self._stands(odometry):
                self._hardware.disarm()
        elif odometry is not None:
            self._wheels.reset(odometry.steering_rad)

    def _stands(self, odometry: Odometry | None) -> bool:
        """The ramp is down and the wheel stands, as far as anything measures it."""
        speed_mps = 0.0 if odometry is None else odometry.speed_mps
        return self._wheels.last.speed_mps == 0.0 and abs(speed_mps) < STANDING_MPS

    def _frames(self, now_s: float) -> list[Frame]:
        """What the devices and the host want to send, as far as the transmit guard lets it."""
        state = self._supervision.state
        estop = EstopSource.NETWORK if state is State.ESTOP else EstopSource.NONE
        wanted = self._hardware.frames(now_s, HOST_STATES[state], estop)
        self._guard.motion_allowed = state in (State.RUNNING, State.STOPPING)
        admitted = self._guard.admit(wanted)
        for text in self._guard.take_reports():
            self._telemetry.event("error", f"transmit guard: {text}")
        return admitted

    def _report(
        self,
        at: Stamp,
        inputs: Inputs,
        odometry: Odometry | None,
        observations: list[Observation],
    ) -> None:
        supervision, telemetry = self._supervision, self._telemetry
        mission_time_s = self._role.mission_time_s() if supervision.state is State.RUNNING else None
        telemetry.motion(
            supervision.state,
            supervision.reason,
            mission_time_s,
            odometry,
            [
                Sighting(follower, seen.marker, seen.body_rad, seen.std_rad, _capture_ns(at, seen))
                for seen in observations
                if (follower := self._follower_of.get(seen.marker)) is not None
            ],
        )
        telemetry.estimate(self._role)
        telemetry.observability(self._role.observability)
        telemetry.bearings(observations)
        telemetry.particles(self._role)
        telemetry.status(
            state=supervision.state,
            reason=supervision.reason,
            not_ready=supervision.blockers,
            mission_time_s=mission_time_s,
            loop=inputs.loop,
            bus=inputs.bus,
            blocked_frames=self._guard.blocked.total(),
            steering=drive_health(self._hardware.steering.feedback),
            drive=drive_health(self._hardware.drive.feedback),
            formation=self._role.formation,
            changed=supervision.changed,
        )


def _capture_ns(at: Stamp, seen: Observation) -> int:
    return round((at.now_s - seen.age_s) * 1e9)
