"""The state machine: what its table promises, for every sequence of events."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.safety.states import TABLE, Event, Refusal, State, StateMachine, Transition

UNPOWERED = {State.STANDBY, State.FAULT, State.ESTOP}
POWERED = set(State) - UNPOWERED
EVENTS = st.lists(st.tuples(st.sampled_from(Event), st.booleans()), max_size=40)


def after(*events: Event) -> StateMachine:
    machine = StateMachine()
    for event in events:
        assert isinstance(machine.handle(event, f"because of {event}"), Transition)
    return machine


RUNNING = (Event.ARM, Event.DRIVES_ACTIVE, Event.START)


def test_a_mission_goes_through_the_states_in_order() -> None:
    machine = StateMachine()
    seen = [machine.state]
    for event in (*RUNNING, Event.MISSION_ENDED, Event.STOPPED):
        machine.handle(event, "test")
        seen.append(machine.state)
    assert [state.value for state in seen] == [
        "STANDBY",
        "ARMING",
        "ARMED",
        "RUNNING",
        "STOPPING",
        "STANDBY",
    ]


@given(EVENTS)
def test_running_is_reached_from_armed_only_and_armed_from_arming_only(
    events: list[tuple[Event, bool]],
) -> None:
    machine = StateMachine()
    for event, blocked in events:
        before = machine.state
        machine.handle(event, "test", ["blocked"] if blocked else [])
        if machine.state is State.RUNNING and before is not State.RUNNING:
            assert before is State.ARMED
        if machine.state is State.ARMED and before is not State.ARMED:
            assert before is State.ARMING


@given(EVENTS)
def test_fault_and_estop_are_left_by_an_unblocked_reset_only(
    events: list[tuple[Event, bool]],
) -> None:
    machine = StateMachine()
    for event, blocked in events:
        before = machine.state
        machine.handle(event, "test", ["blocked"] if blocked else [])
        if before is State.ESTOP and machine.state is not State.ESTOP:
            assert (event, blocked, machine.state) == (Event.RESET, False, State.STANDBY)
        if before is State.FAULT and machine.state is not State.FAULT:
            assert event is Event.ESTOP or (event, blocked) == (Event.RESET, False)


@pytest.mark.parametrize("cause", [Event.IDLE_DRIVES, Event.ESTOP])
def test_a_reset_is_refused_while_the_cause_stands(cause: Event) -> None:
    machine = after(Event.ARM, cause)
    latched = machine.state
    answer = machine.handle(Event.RESET, "reset by a test", ["still asked for: bus lost"])
    assert isinstance(answer, Refusal)
    assert (machine.state, answer.reason) == (latched, "still asked for: bus lost")
    assert isinstance(machine.handle(Event.RESET, "reset by a test"), Transition)
    assert machine.state is State.STANDBY


@given(EVENTS)
def test_every_answer_says_what_happened(events: list[tuple[Event, bool]]) -> None:
    machine = StateMachine()
    for number, (event, blocked) in enumerate(events):
        before, reason_before = machine.state, machine.reason
        answer = machine.handle(event, f"reason {number}", ["blocked"] if blocked else [])
        assert answer.reason
        if isinstance(answer, Transition):
            assert (answer.source, answer.target) == (before, machine.state)
            assert answer.reason == machine.reason
        else:
            assert (machine.state, machine.reason) == (before, reason_before)


@pytest.mark.parametrize("state", sorted(set(State) - {State.ESTOP}))
def test_an_emergency_stop_is_obeyed_everywhere(state: State) -> None:
    assert TABLE[state][Event.ESTOP].targets == (State.ESTOP,)


@pytest.mark.parametrize("state", sorted(POWERED))
def test_every_powered_state_can_be_stopped_by_a_fault(state: State) -> None:
    assert TABLE[state][Event.FAULT_STOP].targets == (State.STOPPING,)
    assert TABLE[state][Event.IDLE_DRIVES].targets == (State.FAULT,)


def test_the_table_covers_every_state_and_no_state_is_a_dead_end() -> None:
    assert set(TABLE) == set(State)
    reachable = {State.STANDBY}
    for _ in State:
        reachable |= {
            target
            for state in reachable
            for rule in TABLE[state].values()
            for target in rule.targets
        }
    assert reachable == set(State)
    assert all(TABLE[state] for state in State)


@pytest.mark.parametrize("cause", [Event.STOP, Event.CONTROLLED_STOP, Event.MISSION_ENDED])
def test_a_stop_without_a_fault_ends_in_standby(cause: Event) -> None:
    assert after(*RUNNING, cause, Event.STOPPED).state is State.STANDBY


def test_a_stop_for_a_fault_ends_in_fault_and_keeps_its_reason() -> None:
    machine = after(*RUNNING)
    machine.handle(Event.FAULT_STOP, "drive: watchdog")
    transition = machine.handle(Event.STOPPED, "standing")
    assert transition == Transition(State.STOPPING, State.FAULT, Event.STOPPED, "drive: watchdog")


def test_a_fault_during_a_controlled_stop_makes_it_a_faults_stop_once() -> None:
    machine = after(*RUNNING, Event.CONTROLLED_STOP)
    assert isinstance(machine.handle(Event.FAULT_STOP, "first fault"), Transition)
    again = machine.handle(Event.FAULT_STOP, "second fault")
    assert isinstance(again, Refusal)
    assert machine.reason == "first fault"
    machine.handle(Event.STOPPED, "standing")
    assert machine.state is State.FAULT


def test_a_fault_of_the_past_does_not_colour_the_next_stop() -> None:
    machine = after(*RUNNING, Event.FAULT_STOP, Event.STOPPED, Event.RESET, *RUNNING, Event.STOP)
    machine.handle(Event.STOPPED, "standing")
    assert machine.state is State.STANDBY


def test_a_stop_that_takes_too_long_is_a_fault() -> None:
    assert after(*RUNNING, Event.STOP, Event.STOP_OVERDUE).state is State.FAULT


def test_arming_is_refused_with_every_blocker() -> None:
    machine = StateMachine()
    answer = machine.handle(Event.ARM, "operator", ["no leader", "no bus"])
    assert answer == Refusal(State.STANDBY, Event.ARM, "no leader; no bus")


def test_an_impossible_event_is_refused_by_name() -> None:
    answer = StateMachine().handle(Event.START, "operator")
    assert isinstance(answer, Refusal)
    assert answer.reason == "START is not possible in STANDBY (started)"
