"""What the operator asks of a running fleet, each answered with a report."""

import time
from collections.abc import Mapping, Sequence
from typing import Literal

import msgspec

from config.fleet import Fleet
from config.formations import DEFAULT, formation_names
from config.messages import CommandReply, Status
from groundstation.errors import GroundError
from groundstation.fleet_link import FleetLink
from groundstation.formation_tree import leader_of, start_order
from groundstation.mission_log import BAD_STATES

DISCOVERY_S = 3.0
ESTOP_LIMIT_S = 3.0
STALE_AFTER_S = 0.5

CommandName = Literal["arm", "start", "stop", "reset", "at_start", "formation"]


class RobotReport(msgspec.Struct, frozen=True):
    """One robot's status and how old it is; all None when nothing was heard."""

    state: str | None
    reason: str | None
    age_s: float | None
    status: Status | None


class StatusReport(msgspec.Struct, frozen=True):
    """The fleet's status. `ok`: every robot is heard, fresh and in no bad state."""

    ok: bool
    fleet: str
    robots: dict[str, RobotReport]


class Answer(msgspec.Struct, frozen=True):
    """One robot's answer to a command."""

    accepted: bool
    reason: str


class CommandReport(msgspec.Struct, frozen=True):
    """Every robot's answer. `ok`: all accepted."""

    ok: bool
    fleet: str
    command: str
    robots: dict[str, Answer]


def status(fleet: Fleet) -> StatusReport:
    """What every robot says of itself. Raises GroundError when no robot is heard at all."""
    with FleetLink.as_visitor(fleet) as link:
        _discover(fleet, link)
        robots = {name: _robot_report(link, name) for name in fleet.robots}
    good = all(
        robot.age_s is not None and robot.age_s <= STALE_AFTER_S and robot.state not in BAD_STATES
        for robot in robots.values()
    )
    return StatusReport(good, fleet.name, robots)


def command(
    fleet: Fleet, name: CommandName, override: Sequence[str] = (), formation: str = ""
) -> CommandReport:
    """Send a command to every robot, see `send`.

    Raises GroundError when no robot is heard at all, and for an unknown formation.
    """
    if name == "formation" and formation not in formation_names(fleet):
        known = ", ".join(formation_names(fleet))
        raise GroundError(f"fleet {fleet.name} has no formation {formation!r}; known are {known}")
    with FleetLink.as_visitor(fleet) as link:
        _discover(fleet, link)
        before = {robot: _formation(link, robot) for robot in fleet.robots}
        return _report(fleet, name, send(fleet, link, name, override, formation, before))


def send(
    fleet: Fleet,
    link: FleetLink,
    name: str,
    override: Sequence[str] = (),
    formation: str = "",
    before: Mapping[str, str] | None = None,
    by: str | None = None,
) -> dict[str, CommandReply]:
    """Send a command to every robot through a link.

    Followers start first; the leader is not started when one of them refuses. Where a robot does
    not take a new formation, the others go back to the one that they had, in `before`.
    `override` names checks before arming that are to be left aside; `by` is the operator.
    """
    if name == "start":
        return _start(fleet, link, by)
    replies = link.command(name, list(fleet.robots), override, formation, by)
    refused = [robot for robot, reply in replies.items() if not reply.accepted]
    if name != "formation" or not refused:
        return replies
    reason = f"back in its formation, because {', '.join(refused)} did not change"
    for robot, reply in replies.items():
        if reply.accepted and before is not None:
            link.command(name, [robot], formation=before[robot], by=by)
            replies[robot] = CommandReply(robot=robot, accepted=False, reason=reason)
    return replies


def _formation(link: FleetLink, robot: str) -> str:
    status = link.view.status(robot)
    return DEFAULT if status is None else status.formation or DEFAULT


def estop(fleet: Fleet) -> CommandReport:
    """Repeat the emergency stop until every robot reports ESTOP, or for 3 s."""
    with FleetLink.as_visitor(fleet) as link:
        reached = link.estop(ESTOP_LIMIT_S)
        answers = {
            name: Answer(True, "in ESTOP") if done else Answer(False, _not_stopped(link, name))
            for name, done in reached.items()
        }
    return CommandReport(all(reached.values()), fleet.name, "estop", answers)


def _discover(fleet: Fleet, link: FleetLink) -> None:
    """Wait until every robot was heard; those that were not are reported one by one later."""
    link.wait_until(lambda: all(map(link.view.status, fleet.robots)), DISCOVERY_S)
    if not any(map(link.view.status, fleet.robots)):
        raise GroundError(
            f"no robot of fleet {fleet.name} is heard within {DISCOVERY_S:g} s through "
            f"{fleet.ground}: is it running (echelon demo), and is this its endpoint (--ground)?"
        )


def _start(fleet: Fleet, link: FleetLink, by: str | None) -> dict[str, CommandReply]:
    leader = leader_of(fleet)
    followers = [name for name in start_order(fleet) if name != leader]
    replies = link.command("start", followers, by=by)
    refused = [name for name, reply in replies.items() if not reply.accepted]
    if refused:
        reason = f"not sent, because {', '.join(refused)} did not start"
        return {leader: CommandReply(robot=leader, accepted=False, reason=reason)} | replies
    return link.command("start", [leader], by=by) | replies


def _report(fleet: Fleet, name: str, replies: dict[str, CommandReply]) -> CommandReport:
    answers = {
        robot: Answer(replies[robot].accepted, replies[robot].reason) for robot in fleet.robots
    }
    return CommandReport(all(each.accepted for each in answers.values()), fleet.name, name, answers)


def _robot_report(link: FleetLink, name: str) -> RobotReport:
    heard = link.view.status(name)
    if heard is None:
        return RobotReport(None, None, None, None)
    age_s = link.view.age_s(name, time.time_ns())
    return RobotReport(heard.state, heard.reason, age_s, heard)


def _not_stopped(link: FleetLink, name: str) -> str:
    state = link.view.state(name)
    heard = f"still {state}" if state else "nothing heard from it"
    return f"{heard} after {ESTOP_LIMIT_S:g} s: stop it by hand"


def to_json(report: StatusReport | CommandReport) -> str:
    """The report as an indented JSON document."""
    return msgspec.json.format(msgspec.json.encode(report), indent=2).decode()


def to_text(report: StatusReport | CommandReport) -> str:
    """The report for people, one line per robot."""
    if isinstance(report, StatusReport):
        return "\n".join(_status_line(name, robot) for name, robot in report.robots.items())
    return "\n".join(
        f"{name}: {report.command} {'accepted' if answer.accepted else 'NOT ACCEPTED'}"
        f"{f': {answer.reason}' if answer.reason else ''}"
        for name, answer in report.robots.items()
    )


def _status_line(name: str, robot: RobotReport) -> str:
    if robot.status is None or robot.age_s is None:
        return f"{name}: nothing heard"
    ready = "ready" if robot.status.ready else f"not ready: {', '.join(robot.status.not_ready)}"
    reason = f" ({robot.reason})" if robot.reason else ""
    return (
        f"{name}: {robot.state}{reason}, {ready}, loop p99 {robot.status.loop.p99_ms:.2f} ms, "
        f"{robot.age_s * 1e3:.0f} ms old"
    )
