"""What keeps a robot safe within a step: checks, state machine, operator's commands, drives' power.

A fault's path: device driver -> `_look` -> `safety.failsafe.evaluate` -> `safety.states` ->
`_follow_state` (power of the drives) and, for the ramp, `Robot._drive`.
"""

from config.fleet import Robot
from config.messages import CommandReply
from onboard.canbus.port import BusState
from onboard.hardware import Hardware, drive_seen
from onboard.role import Observation, Odometry, Role, Stamp
from onboard.safety import failsafe
from onboard.safety.observations import Observations
from onboard.safety.preflight.checklist import not_ready
from onboard.safety.states import Event, Refusal, State, StateMachine, Transition
from onboard.step import Inputs, Request
from onboard.telemetry import Telemetry

POWERED = (State.ARMING, State.ARMED, State.RUNNING, State.STOPPING)
COMMANDS = {"arm": Event.ARM, "start": Event.START, "stop": Event.STOP, "reset": Event.RESET}
# Beyond the ramp itself: what the drives may take to report that they are idle.
STOP_SLACK_S = 2.0
# An e-stop is repeated at 20 Hz; this long after the last one it counts as withdrawn.
ESTOP_HOLD_S = 0.5


class Supervision:
    """State machine of one robot with everything that feeds it and everything it switches."""

    def __init__(
        self,
        name: str,
        settings: Robot,
        role: Role,
        hardware: Hardware,
        telemetry: Telemetry,
    ) -> None:
        self._name, self._settings, self._role = name, settings, role
        self._hardware, self._telemetry = hardware, telemetry
        self._states = StateMachine()
        self._bearing_s: float | None = None
        self._stop_began_s = 0.0
        self._estop_s: float | None = None
        self._shutdown = False
        self.blockers: list[str] = []
        self.changed = False

    @property
    def state(self) -> State:
        """State of the state machine."""
        return self._states.state

    @property
    def reason(self) -> str:
        """Why the robot is in its state."""
        return self._states.reason

    @property
    def finished(self) -> bool:
        """True once a shutdown was asked for and the drives are let go of."""
        return self._shutdown and self.state not in POWERED and not self._hardware.powered

    def step(
        self,
        at: Stamp,
        inputs: Inputs,
        odometry: Odometry | None,
        observations: list[Observation],
    ) -> list[tuple[int, CommandReply]]:
        """Judge this cycle, change state where needed, answer the operator."""
        self.changed = False
        seen = self._look(at, inputs, observations)
        unready = self._role.not_ready() + self._role.observability.not_ready()
        self.blockers = not_ready(seen, self._settings.failsafe) + unready
        if odometry is None and not self.blockers:
            self.blockers = ["no odometry: the drive or the steering encoder has just gone silent"]
        self._watch(at, seen, inputs.shutdown)
        replies = [self._answer(at, request, odometry) for request in inputs.requests]
        self._follow_state(at)
        return replies

    def _look(self, at: Stamp, inputs: Inputs, observations: list[Observation]) -> Observations:
        watched = [seen.age_s for seen in observations if self._role.watches(seen.marker)]
        if watched:
            self._bearing_s = at.now_s - min(watched)
        if inputs.estops:
            self._estop_s = at.now_s
        hardware, now_s = self._hardware, at.now_s
        return Observations(
            state=self.state,
            leader=self._role.leader_seen(at),
            bearing_age_s=None if self._bearing_s is None else now_s - self._bearing_s,
            bearing_problem=hardware.sensor.problem(now_s),
            estimate_problem=self._role.estimate_problem() or self._role.observability.problem(),
            drive=drive_seen(hardware.drive.feedback, now_s),
            steering=drive_seen(hardware.steering.feedback, now_s),
            encoder_age_s=hardware.encoder.stale_for(now_s),
            encoder_problem=hardware.encoder.problem(now_s) or self._disagreement(),
            bus_state=BusState(inputs.bus.state),
            bus_reason=inputs.bus.reason,
            loop_late_s=inputs.late_s,
            estop_by=inputs.estops[-1].operator if inputs.estops else None,
        )

    def _disagreement(self) -> str | None:
        """Steering drive against encoder; they are aligned when arming begins, not before."""
        return self._hardware.steering_disagreement() if self.state in POWERED else None

    def _watch(self, at: Stamp, seen: Observations, shutdown: bool) -> None:
        """Everything that changes the state without an operator's command."""
        if self.state is State.RUNNING and (reason := self._role.ended()) is not None:
            self._handle(at, Event.MISSION_ENDED, reason)
        verdict = failsafe.evaluate(seen, self._settings.failsafe)
        if verdict.action is failsafe.Action.ESTOP or (
            verdict.action is not failsafe.Action.NONE and self.state in POWERED
        ):
            self._handle(at, failsafe.EVENT_OF[verdict.action], verdict.reason)
        if shutdown and not self._shutdown:
            self._shutdown = True
            self._handle(at, Event.STOP, "the onboard process is being stopped")

    def _answer(
        self, at: Stamp, request: Request, odometry: Odometry | None
    ) -> tuple[int, CommandReply]:
        number, command = request
        event = COMMANDS.get(command.name)
        if event is None:
            known = ", ".join(COMMANDS)
            return number, self._refused(f"unknown command {command.name!r}; known are {known}")
        blockers = self._reset_blockers(at) if event is Event.RESET else self.blockers
        result = self._handle(at, event, f"{command.name} by {command.operator}", blockers)
        if isinstance(result, Refusal):
            return number, self._refused(result.reason)
        if event is Event.ARM and (problem := self._hardware.arm()) is not None:
            self._handle(at, Event.STOP, f"arming failed: {problem}")
            return number, self._refused(problem)
        if event is Event.START and odometry is not None:
            self._role.start(odometry.steering_rad)
        if event is Event.RESET:
            self._hardware.clear_faults()
        return number, CommandReply(robot=self._name, accepted=True, reason=result.reason)

    def _refused(self, reason: str) -> CommandReply:
        return CommandReply(robot=self._name, accepted=False, reason=reason)

    def _reset_blockers(self, at: Stamp) -> list[str]:
        if self._estop_s is not None and at.now_s - self._estop_s < ESTOP_HOLD_S:
            return ["the emergency stop is still being sent"]
        return []

    def _follow_state(self, at: Stamp) -> None:
        """Switch the drives as the state demands, and report what they have done."""
        if self.state is State.ARMING and self._hardware.active:
            self._handle(at, Event.DRIVES_ACTIVE, "both drives in closed-loop control")
        elif self.state is State.STOPPING:
            if not self._hardware.powered:
                self._handle(at, Event.STOPPED, "standing, drives idle")
            elif at.now_s - self._stop_began_s > self._stop_limit_s():
                self._handle(
                    at,
                    Event.STOP_OVERDUE,
                    f"not standing {self._stop_limit_s():.1f} s after: {self.reason}",
                )
        elif self.state is State.FAULT:
            self._hardware.disarm()

    def _stop_limit_s(self) -> float:
        limits = self._settings.limits
        return limits.speed_mps / limits.deceleration_mps2 + STOP_SLACK_S

    def _handle(
        self, at: Stamp, event: Event, reason: str, blockers: list[str] | None = None
    ) -> Transition | Refusal:
        result = self._states.handle(event, reason, blockers or [])
        if isinstance(result, Refusal):
            return result
        self.changed = True
        if result.source is State.RUNNING:
            self._role.finish()
        if result.target is State.STOPPING and result.source is not State.STOPPING:
            self._stop_began_s = at.now_s
        if result.target is State.ESTOP and result.source is not State.ESTOP:
            self._hardware.estop()
        severity = "error" if result.target in (State.FAULT, State.ESTOP) else "info"
        self._telemetry.event(severity, f"{result.source} -> {result.target}: {result.reason}")
        return result
