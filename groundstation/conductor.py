"""Drives one live run: waits for the robots, arms and starts them, watches, brings them to rest."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from config import topics
from config.fleet import Fleet
from config.messages import Event, encode
from groundstation.fleet_link import POLL_S, FleetLink
from groundstation.formation_tree import leader_of, start_order
from groundstation.heard import Heard
from groundstation.mission_log import BAD_STATES, COMPLETE, GROUND_STATION
from groundstation.progress import Display
from groundstation.recorder import Recorder
from groundstation.summary import Fault
from groundstation.supervisor import Supervisor

SIMULATOR = "sim"
UP_LIMIT_S = 10.0
READY_LIMIT_S = 20.0
CHANGE_LIMIT_S = 3.0
OVERTIME_S = 15.0
REST_LIMIT_S = 5.0
# Robots stop by themselves when something breaks; only then does the ground station step in.
SELF_STOP_S = 1.0
SILENCE_LIMIT_S = 2.0
AT_REST = frozenset({"STANDBY", *BAD_STATES})


class _Aborted(Exception):
    """The run cannot go on. `incidents` are what the robots' own messages do not tell."""

    def __init__(self, incidents: list[Fault]) -> None:
        super().__init__("; ".join(f"{each.robot}: {each.reason}" for each in incidents))
        self.incidents = incidents


class Commands(NamedTuple):
    """Command lines of the processes of a run: the simulated hardware, and one per robot."""

    simulator: Sequence[str]
    robots: Mapping[str, Sequence[str]]


class Conductor:
    """One run from processes that come up to robots that stand still; records all the while."""

    def __init__(
        self,
        fleet: Fleet,
        commands: Commands,
        link: FleetLink,
        recorder: Recorder,
        supervisor: Supervisor,
        display: Display,
        hear: Callable[[Sequence[Heard]], None],
    ) -> None:
        """`hear` gets every message that arrives, after it was recorded."""
        self._fleet = fleet
        self._commands = commands
        self._link = link
        self._recorder = recorder
        self._supervisor = supervisor
        self._display = display
        self._hear = hear
        self._phase = "starting"
        self._started_s = time.monotonic()

    def drive(self) -> list[Fault]:
        """The whole mission. Returns what went wrong outside the robots' own messages."""
        incidents: list[Fault] = []
        grace_s = 0.0
        try:
            self._bring_up()
            self._await_ready()
            self._order("arm", "ARMED")
            self._order("start", "RUNNING")
            self._await_end()
        except _Aborted as aborted:
            incidents, grace_s = aborted.incidents, SELF_STOP_S
            self._record_incidents(incidents)
        self.bring_to_rest(grace_s)
        return incidents

    def _record_incidents(self, incidents: Sequence[Fault]) -> None:
        """As events of the ground station, so that the recording alone tells the whole story."""
        for number, incident in enumerate(incidents):
            event = Event(
                seq=number,
                t_ns=time.monotonic_ns(),
                wall_ns=time.time_ns(),
                source=GROUND_STATION,
                severity="error",
                text=incident.reason,
            )
            key = topics.EVENT.key(self._fleet.name, incident.robot)
            self._recorder.write(key, encode(event), event.wall_ns)

    def bring_to_rest(self, grace_s: float = 0.0) -> None:
        """Let robots stop by themselves for `grace_s`, then command those that still move to.

        Waits a while until all that live stand.
        """
        self._phase = "stopping"
        if self._at_rest_within(grace_s):
            return
        moving = [name for name in self._alive() if self._state(name) not in AT_REST]
        if moving:
            self._link.command("stop", moving)
        self._at_rest_within(REST_LIMIT_S)

    def _at_rest_within(self, limit_s: float) -> bool:
        deadline = time.monotonic() + limit_s
        while True:
            self._pump()
            if all(self._state(name) in {"", *AT_REST} for name in self._alive()):
                return True
            if time.monotonic() >= deadline:
                return False
            time.sleep(POLL_S)

    def _bring_up(self) -> None:
        """Start the simulated hardware and, once it serves the buses, the robots."""
        self._supervisor.start(SIMULATOR, self._commands.simulator)
        if not self._wait(lambda: SIMULATOR in self._link.view.alive, UP_LIMIT_S):
            raise self._abort({SIMULATOR: f"not up within {UP_LIMIT_S:g} s"})
        for name, command in self._commands.robots.items():
            self._supervisor.start(name, command)

    def _await_ready(self) -> None:
        self._phase = "waiting until ready"
        if not self._wait(lambda: not self._unready(), READY_LIMIT_S):
            raise self._abort(
                {
                    name: f"not ready within {READY_LIMIT_S:g} s: {text}"
                    for name, text in self._unready().items()
                }
            )

    def _unready(self) -> dict[str, str]:
        """Robots that are not ready, and what they lack."""
        lacking: dict[str, str] = {}
        for name in self._fleet.robots:
            status = self._link.view.status(name)
            if status is None:
                lacking[name] = "nothing heard from it"
            elif not status.ready:
                lacking[name] = ", ".join(status.not_ready) or "it gives no reason"
        return lacking

    def _order(self, command: str, state: str) -> None:
        """Give all robots a command, the leader last, and wait until all are in the state."""
        self._phase = f"{command}ing"
        for name in start_order(self._fleet):
            reply = self._link.command(command, [name])[name]
            self._pump()
            self._check()
            if not reply.accepted:
                raise self._abort({name: f"refuses to {command}: {reply.reason}"})
        self._wait_for_states(frozenset({state}), CHANGE_LIMIT_S)

    def _await_end(self) -> None:
        self._phase = "driving"
        limit_s = self._fleet.mission.duration_s + OVERTIME_S
        if not self._wait(lambda: self._ended() or self._stopped_early(), limit_s):
            raise self._abort(
                {
                    name: f"still {self._state(name) or 'silent'} after {limit_s:g} s"
                    for name in self._fleet.robots
                    if self._state(name) != "STANDBY"
                }
            )
        if self._stopped_early():
            raise self._abort({})

    def _ended(self) -> bool:
        return all(self._state(name) == "STANDBY" for name in self._fleet.robots)

    def _stopped_early(self) -> bool:
        """Whether a robot stands although the mission is not complete (its status says why)."""
        statuses = [self._link.view.status(name) for name in self._fleet.robots]
        return any(
            status is not None
            and status.state == "STANDBY"
            and not status.reason.endswith(COMPLETE)
            for status in statuses
        )

    def _wait_for_states(self, wanted: frozenset[str], limit_s: float) -> None:
        def others() -> dict[str, str]:
            states = {name: self._state(name) for name in self._fleet.robots}
            return {name: state for name, state in states.items() if state not in wanted}

        if not self._wait(lambda: not others(), limit_s):
            raise self._abort(
                {
                    name: f"still {state or 'silent'} after {limit_s:g} s, not {', '.join(wanted)}"
                    for name, state in others().items()
                }
            )

    def _wait(self, reached: Callable[[], bool], limit_s: float) -> bool:
        deadline = time.monotonic() + limit_s
        while True:
            self._pump()
            if reached():
                return True
            self._check()
            if time.monotonic() > deadline:
                return False
            time.sleep(POLL_S)

    def _pump(self) -> None:
        """Take in and record what arrived, and show it."""
        heard = self._link.poll()
        for _, key, payload, message in heard:
            self._recorder.write(key, payload, message.wall_ns)
        self._hear(heard)
        for text in self._link.unreadable:
            self._display.note(text)
        self._link.unreadable.clear()
        self._recorder.tick(time.monotonic())
        for text in self._recorder.take_notes():
            self._display.note(text)
        self._display.update(self._phase, self._fleet, self._link.view)

    def _check(self) -> None:
        """Abort when a process died, a robot fell silent or is in a bad state (it says why)."""
        ended = self._supervisor.ended()
        if ended:
            raise self._abort({each.name: str(each) for each in ended})
        silent = self._silent()
        if silent:
            raise self._abort(
                {name: f"nothing heard for {age_s:.1f} s" for name, age_s in silent.items()}
            )
        if any(self._state(name) in BAD_STATES for name in self._fleet.robots):
            raise self._abort({})

    def _abort(self, reasons: dict[str, str]) -> _Aborted:
        t_s = round(self._time_s(), 3)
        return _Aborted([Fault(name, t_s, reason) for name, reason in reasons.items()])

    def _time_s(self) -> float:
        """Mission time, or time since the start where there is none."""
        leader = self._link.view.motion(leader_of(self._fleet))
        if leader is not None and leader.mission_time_s is not None:
            return leader.mission_time_s
        return time.monotonic() - self._started_s

    def _alive(self) -> list[str]:
        """Robots whose process runs and that have not fallen silent."""
        lost = {each.name for each in self._supervisor.ended()} | self._silent().keys()
        return [name for name in self._fleet.robots if name not in lost]

    def _silent(self) -> dict[str, float]:
        """Robots that were heard but have fallen silent, and the age [s] of their last status."""
        ages = {name: self._link.view.age_s(name, time.time_ns()) for name in self._fleet.robots}
        return {
            name: age_s
            for name, age_s in ages.items()
            if age_s is not None and age_s > SILENCE_LIMIT_S
        }

    def _state(self, name: str) -> str:
        return self._link.view.state(name)
