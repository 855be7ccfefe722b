"""What keeps a robot safe within a step: checks, state machine, operator's commands, drives' power.

A fault's path: device driver -> `Lookout` -> `safety.failsafe` -> `safety.states` ->
`_follow_state` (power of the drives) and, for the ramp, `Robot._drive`.
"""

from collections.abc import Sequence

from config.fleet import Robot
from config.messages import Command, CommandReply
from onboard.hardware import Hardware
from onboard.lookout import POWERED, Lookout
from onboard.role import Observation, Odometry, Role, Stamp
from onboard.safety.failsafe import EVENT_OF, Action, FailsafeTable
from onboard.safety.observations import Observations
from onboard.safety.preflight.checklist import Blocker, not_ready, refused_overrides
from onboard.safety.states import Event, Refusal, State, StateMachine, Transition
from onboard.step import Inputs, Request
from onboard.telemetry import Telemetry

COMMANDS = {"arm": Event.ARM, "start": Event.START, "stop": Event.STOP, "reset": Event.RESET}
FORMATION, AT_START = "formation", "at_start"
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
        formations: Sequence[str],
    ) -> None:
        self._formations = formations
        self._name, self._settings, self._role = name, settings, role
        self._hardware, self._telemetry = hardware, telemetry
        self._states = StateMachine()
        self._lookout = Lookout(settings, role, hardware)
        self._failsafe = FailsafeTable(settings.failsafe)
        self._overridden: frozenset[str] = frozenset()
        self._stop_began_s = 0.0
        self._estop_s: float | None = None
        self._shutdown = False
        self._blockers: list[Blocker] = []
        self._latched: str | None = None
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
    def blockers(self) -> list[str]:
        """What speaks against arming, overrides aside."""
        return [str(each) for each in self._blockers]

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
        if inputs.estops:
            self._estop_s = at.now_s
        seen = self._lookout.look(at, inputs, observations, self.state)
        self._blockers = self._found(seen, odometry)
        self._watch(at, seen)
        replies = [self._answer(at, request, odometry) for request in inputs.requests]
        self._follow_state(at)
        return replies

    def _found(self, seen: Observations, odometry: Odometry | None) -> list[Blocker]:
        unready = self._role.not_ready() + self._role.observability.not_ready()
        found = not_ready(seen, self._settings, unready)
        if odometry is None and not found:
            text = "no odometry: the drive or the steering encoder has just gone silent"
            found = [Blocker("estimate", text)]
        return found

    def _watch(self, at: Stamp, seen: Observations) -> None:
        """Everything that changes the state without an operator's command."""
        if self.state is State.RUNNING and (reason := self._role.ended()) is not None:
            self._handle(at, Event.MISSION_ENDED, reason)
        judged = self._failsafe.judge(seen, at.now_s, self.state in POWERED)
        self._role.restrain(judged.slow, judged.hold_distance)
        for told in judged.news:
            action = told.action.name.lower()
            self._telemetry.event("warning", f"failsafe {told.trigger}: {told.reason}: {action}")
        worst = judged.worst
        self._latched = worst.reason if worst.action is Action.ESTOP else None
        if worst.action in EVENT_OF:
            self._handle(at, EVENT_OF[worst.action], worst.reason)
        self._shutdown = self._shutdown or seen.ending

    def _answer(
        self, at: Stamp, request: Request, odometry: Odometry | None
    ) -> tuple[int, CommandReply]:
        number, command = request
        if command.name == FORMATION:
            return number, self._change_formation(command)
        if command.name == AT_START:
            return number, self._begin_anew(command)
        event = COMMANDS.get(command.name)
        if event is None:
            known = ", ".join((*COMMANDS, FORMATION, AT_START))
            return number, self._refused(f"unknown command {command.name!r}; known are {known}")
        if problem := refused_overrides(command.override, self._settings):
            return number, self._refused(problem)
        blockers = self._blocking(at, event, command)
        result = self._handle(at, event, f"{command.name} by {command.operator}", blockers)
        if isinstance(result, Refusal):
            return number, self._refused(result.reason)
        self._record_overrides(event, command)
        if event is Event.ARM and (problem := self._hardware.arm()) is not None:
            self._handle(at, Event.STOP, f"arming failed: {problem}")
            return number, self._refused(problem)
        if event is Event.START and odometry is not None:
            self._role.start(odometry.steering_rad)
        if event is Event.RESET:
            self._hardware.clear_faults()
        return number, CommandReply(robot=self._name, accepted=True, reason=result.reason)

    def _change_formation(self, command: Command) -> CommandReply:
        if command.formation not in self._formations:
            known = ", ".join(self._formations)
            return self._refused(f"no formation {command.formation!r} here; known are {known}")
        if command.formation != self._role.formation:
            self._role.change_formation(command.formation)
            self.changed = True
            text = f"formation {command.formation} by {command.operator}"
            self._telemetry.event("info", text)
        return CommandReply(robot=self._name, accepted=True, reason="")

    def _begin_anew(self, command: Command) -> CommandReply:
        if self.state is not State.STANDBY:
            wanted = f"{AT_START} is possible in STANDBY only, not in {self.state} ({self.reason})"
            return self._refused(wanted)
        self._role.begin_anew()
        self._telemetry.event("warning", f"estimate begun anew: {AT_START} by {command.operator}")
        return CommandReply(robot=self._name, accepted=True, reason="the estimate begins anew")

    def _refused(self, reason: str) -> CommandReply:
        return CommandReply(robot=self._name, accepted=False, reason=reason)

    def _blocking(self, at: Stamp, event: Event, command: Command) -> list[str]:
        """What stands against a command; ARM's overrides hold for START too."""
        if event is Event.RESET:
            return self._reset_blockers(at)
        left_aside = self._overridden.union(command.override)
        return [str(each) for each in self._blockers if each.check not in left_aside]

    def _record_overrides(self, event: Event, command: Command) -> None:
        """Every check that was left aside becomes an event; reset and stop end the leave."""
        if event not in (Event.ARM, Event.START):
            self._overridden = frozenset()
            return
        for name in command.override:
            reasons = [each.reason for each in self._blockers if each.check == name]
            found = "; ".join(reasons) or "it passes"
            text = f"check {name} overridden by {command.operator} to {command.name}: {found}"
            self._telemetry.event("warning", text)
        kept = self._overridden if event is Event.START else frozenset()
        self._overridden = kept.union(command.override)

    def _reset_blockers(self, at: Stamp) -> list[str]:
        if self._estop_s is not None and at.now_s - self._estop_s < ESTOP_HOLD_S:
            return ["the emergency stop is still being sent"]
        return [] if self._latched is None else [f"still asked for: {self._latched}"]

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
        if result.target not in POWERED and event is not Event.ARM:
            self._overridden = frozenset()
        if result.target is State.STOPPING and result.source is not State.STOPPING:
            self._stop_began_s = at.now_s
        if result.target is State.ESTOP and result.source is not State.ESTOP:
            self._hardware.estop()
        severity = "error" if result.target in (State.FAULT, State.ESTOP) else "info"
        self._telemetry.event(severity, f"{result.source} -> {result.target}: {result.reason}")
        return result
