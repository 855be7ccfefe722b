"""One run: from the moment before the fault until everything stands, or nothing more happens."""

from collections.abc import Callable, Sequence

from config.faults import Fault
from groundstation.formation_tree import start_order
from groundstation.lockstep import AT_REST, COMMAND_LIMIT_S, Lockstep
from tests.campaign.scenario import Phase, Role, bring_to, fleet_of
from tests.campaign.witness import Outcome, Witness

INTO_ARMING_S = 0.03
"""After the reply to "arm": the drives are in closed loop, the robot has not heard of it yet."""
ARMED_FOR_S = 1.0
"""What an operator takes from "armed" to "start"."""
SETTLED_S = 0.3


class Trial:
    """A fleet brought to a phase; `run` breaks it, once."""

    def __init__(self, role: Role, phase: Phase, seed: int) -> None:
        self.fleet = fleet_of(role, phase)
        self.phase = phase
        self._witness = Witness(self.fleet)
        self._lockstep = Lockstep(self.fleet, seed, self._witness.hear)
        bring_to(self._lockstep, phase)

    def run(self, faults: Sequence[Fault], watched: Sequence[str], horizon_s: float) -> Outcome:
        """Let the faults begin (`at_s` counts from now) and look on.

        Ends once the `watched` robots stand without power, `horizon_s` after the mission has
        begun at the latest.
        """
        if self.phase is Phase.ARMING:
            self._arm(faults)
        else:
            self._begin(faults)
        settled = _Settled(lambda: self._at_rest(watched), SETTLED_S)
        self._until(lambda: settled.since(self._lockstep.now_s), horizon_s)
        return self._witness.outcome(self._lockstep)

    def close(self) -> None:
        """Leave the buses."""
        self._lockstep.__exit__(None, None, None)

    def _begin(self, faults: Sequence[Fault], delay_s: float = 0.0) -> None:
        self._until(lambda: False, delay_s)
        self._witness.begin(self._lockstep)
        for fault in faults:
            self._lockstep.simulation.inject(fault, self._lockstep.now_s + fault.at_s)

    def _arm(self, faults: Sequence[Fault]) -> None:
        """The operator arms, waits a moment, starts; and stops all where one does not come along.

        The faults begin while the first robot to break is arming.
        """
        order, first = start_order(self.fleet), faults[0].robot
        order = [name for name in order if name != first]
        for name in order:
            self._command(name, "arm")
        self._command(first, "arm")
        self._begin(faults, INTO_ARMING_S)
        self._until(lambda: self._all("ARMED") or self._at_rest([first]), COMMAND_LIMIT_S)
        self._until(lambda: not self._all("ARMED"), ARMED_FOR_S)
        if not self._all("ARMED"):
            return self._stop_all()
        for name in start_order(self.fleet):
            if not self._command(name, "start"):
                return self._stop_all()
            self._witness.starts(name)
        return None

    def _all(self, state: str) -> bool:
        return all(str(each.robot.state) == state for each in self._lockstep.stations.values())

    def _command(self, name: str, command: str) -> bool:
        reply = self._lockstep.command(name, command)
        if not reply.accepted:
            self._witness.gives_up(name, f"refuses to {command}: {reply.reason}")
        return reply.accepted

    def _stop_all(self) -> None:
        for name in start_order(self.fleet):
            self._lockstep.command(name, "stop")

    def _until(self, condition: Callable[[], bool], limit_s: float) -> bool:
        end_s = self._lockstep.now_s + limit_s
        while not condition():
            if self._lockstep.now_s >= end_s:
                return False
            self._lockstep.tick()
            self._witness.look(self._lockstep)
        return True

    def _at_rest(self, names: Sequence[str]) -> bool:
        stations = self._lockstep.stations
        return all(str(stations[name].robot.state) in AT_REST for name in names)


class _Settled:
    """True once a condition has held for so long."""

    def __init__(self, condition: Callable[[], bool], for_s: float) -> None:
        self._condition, self._for_s = condition, for_s
        self._since_s: float | None = None

    def since(self, now_s: float) -> bool:
        if not self._condition():
            self._since_s = None
            return False
        self._since_s = now_s if self._since_s is None else self._since_s
        return now_s - self._since_s >= self._for_s
