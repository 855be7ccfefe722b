"""Runs the recorded inputs through the same onboard code and compares every output, bit for bit.

Estimators, control, safety and the drivers are deterministic, so any difference is a change of the
code, of a library or of the machine.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec

from config import topics
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.messages import (
    Message,
    RobotStart,
    StepRecord,
    StepReply,
    Version,
    encode,
)
from groundstation import keys
from groundstation.errors import GroundError
from groundstation.recording import keys_in, parse_fleet, read_messages
from groundstation.series import topic_of
from onboard.robot import Robot
from onboard.step import Outputs
from onboard.step_record import inputs_of, messages_crc, sent_frames, versions

Progress = Callable[[str, int], None]
COMPARED = (*topics.STEP_RECORD, *topics.ROBOTS_OWN)
SHOWN_CHARACTERS = 160
PROGRESS_EVERY = 500


class Difference(msgspec.Struct, frozen=True):
    """The first output that is not what was recorded. `t_s` is the robot's monotonic time."""

    topic: str
    t_s: float
    step: int
    what: str

    def __str__(self) -> str:
        return f"{self.topic} at {self.t_s:.3f} s (step {self.step}): {self.what}"


class Gap(msgspec.Struct, frozen=True):
    """Steps that were not recorded: from the first of them on the robot cannot be replayed."""

    first: int
    last: int
    t_s: float

    def __str__(self) -> str:
        steps = f"{self.first} to {self.last}, before {self.t_s:.3f} s"
        return f"steps {steps}, are missing in the recording"


class RobotCheck(msgspec.Struct, frozen=True):
    """One robot: steps replayed, messages compared with recorded ones, what was found."""

    robot: str
    steps: int
    messages: int
    difference: Difference | None = None
    gap: Gap | None = None
    other_versions: list[str] = []

    @property
    def ok(self) -> bool:
        """Every recorded step was replayed and gave the same outputs."""
        return self.difference is None and self.gap is None and self.steps > 0


class ReplayCheck(msgspec.Struct, frozen=True):
    """All robots of a recording."""

    ok: bool
    recording: str
    robots: list[RobotCheck]


class _Record:
    """What was recorded of one robot, by the number of the step or of the message."""

    def __init__(self) -> None:
        self.start: RobotStart | None = None
        self.steps: dict[int, StepRecord] = {}
        self.told: dict[tuple[str, int], bytes] = {}


def check(path: Path, progress: Progress | None = None) -> ReplayCheck:
    """Replay every robot of a recording.

    Raises GroundError when the file is no whole recording, or holds no robot's inputs.
    """
    records = _records(path)
    robots = [_check_robot(name, records[name], progress) for name in sorted(records)]
    return ReplayCheck(all(robot.ok for robot in robots), str(path), robots)


def to_text(report: ReplayCheck) -> str:
    """The findings for people."""
    lines: list[str] = []
    for robot in report.robots:
        lines.append(
            f"{robot.robot}: {robot.steps} steps replayed, {robot.messages} recorded messages "
            + ("compared: the same bit for bit" if robot.ok else "compared")
        )
        lines += [f"  {text}" for text in _findings(robot)]
    return "\n".join([*lines, f"verdict: {'pass' if report.ok else 'fail'}"])


def to_json(report: ReplayCheck) -> str:
    """One JSON document."""
    return msgspec.json.encode(report).decode()


def _findings(robot: RobotCheck) -> Iterator[str]:
    if robot.difference is not None:
        yield f"first difference: {robot.difference}"
    if robot.gap is not None:
        yield f"gap: {robot.gap}"
    if robot.difference is not None and robot.other_versions:
        yield f"recorded with {', '.join(robot.other_versions)}"


def _records(path: Path) -> dict[str, _Record]:
    wanted = [key for key in keys_in(path) if topic_of(key) in COMPARED]
    decoders = {topic: msgspec.json.Decoder(topic.message) for topic in topics.STEP_RECORD}
    head = msgspec.json.Decoder(Message)
    addresses = {key: keys.parse(key) for key in wanted}
    records: dict[str, _Record] = {}
    for each in read_messages(path, wanted):
        address = addresses[each.key]
        record = records.setdefault(address.robot, _Record())
        decoder = decoders.get(address.topic)
        try:
            if decoder is None:
                record.told[each.key, head.decode(each.payload).seq] = each.payload
            else:
                _keep(record, decoder.decode(each.payload))
        except msgspec.MsgspecError as error:
            raise GroundError(
                f"{path}: a message on {each.key} is not understood, it was recorded by another "
                f"version of Echelon: {error}"
            ) from error
    replayable = {name: record for name, record in records.items() if record.steps}
    if not replayable:
        raise GroundError(
            f"{path} holds no robot's inputs: there is nothing to replay (they are on the topics "
            f"{', '.join(topic.name for topic in topics.STEP_RECORD)})"
        )
    return replayable


def _keep(record: _Record, message: msgspec.Struct) -> None:
    if isinstance(message, RobotStart):
        record.start = record.start or message
    elif isinstance(message, StepRecord):
        record.steps[message.seq] = message


def _check_robot(name: str, record: _Record, progress: Progress | None) -> RobotCheck:
    first, last = min(record.steps), max(record.steps)
    if record.start is None or first != 0:
        gap = Gap(0, first - 1 if first else 0, record.steps[first].now_s)
        return RobotCheck(name, 0, 0, gap=gap)
    start = record.start
    fleet = parse_fleet(start.fleet_json, f"the fleet that {name} was started with")
    robot = Robot(fleet, name, CanDatabase.load(), start.seed)
    other = _other_versions(start.versions)
    compared = 0
    for number in range(last + 1):
        step = record.steps.get(number)
        if step is None:
            after = next(n for n in range(number, last + 1) if n in record.steps)
            gap = Gap(number, after - 1, record.steps[after].now_s)
            return RobotCheck(name, number, compared, gap=gap, other_versions=other)
        outputs = robot.step(inputs_of(step))
        count, difference = _compare(fleet.name, name, record, step, outputs)
        compared += count
        if difference is not None:
            return RobotCheck(name, number, compared, difference, other_versions=other)
        if progress is not None and number % PROGRESS_EVERY == 0:
            progress(name, number)
    return RobotCheck(name, last + 1, compared, other_versions=other)


def _compare(
    fleet: str,
    name: str,
    record: _Record,
    step: StepRecord,
    outputs: Outputs,
) -> tuple[int, Difference | None]:
    """How many recorded messages were compared, and the first output that is another one."""
    compared = 0

    def differs(topic: topics.Topic, what: str) -> tuple[int, Difference]:
        return compared, Difference(topic.key(fleet, name), step.now_s, step.seq, what)

    for topic, message in outputs.messages:
        recorded = record.told.get((topic.key(fleet, name), message.seq))
        if recorded is None:
            continue
        compared += 1
        replayed = encode(message)
        if recorded != replayed:
            return differs(topic, _both(recorded, replayed))
    wanted = sent_frames(step)
    if wanted != outputs.frames:
        return differs(topics.STEP, _first_frame(wanted, outputs.frames))
    replies = [StepReply(*reply) for reply in outputs.replies]
    if replies != step.replies:
        return differs(topics.COMMAND, _both(encode_all(step.replies), encode_all(replies)))
    if messages_crc(outputs) != step.messages_crc:
        told = ", ".join(topic.name for topic, _ in outputs.messages) or "none"
        return differs(
            topics.STEP,
            f"check sum of the step's messages was {step.messages_crc:08x}, is "
            f"{messages_crc(outputs):08x}; the replay's messages are {told}, the recorded one that "
            "differs was not received",
        )
    return compared, None


def encode_all(replies: list[StepReply]) -> bytes:
    """Replies as JSON."""
    return b"[" + b",".join(encode(reply) for reply in replies) + b"]"


def _both(recorded: bytes, replayed: bytes) -> str:
    """The part of both texts that begins just before they part."""
    pairs = enumerate(zip(recorded, replayed, strict=False))
    apart = next((at for at, (a, b) in pairs if a != b), min(len(recorded), len(replayed)))
    begin = max(recorded.rfind(b'"', 0, max(apart - 2, 0)), 0)
    begin = max(recorded.rfind(b",", 0, begin), 0)
    shown = [
        text[begin : begin + SHOWN_CHARACTERS].decode(errors="replace").strip(",")
        for text in (recorded, replayed)
    ]
    return f"recorded {shown[0]} ..., replayed {shown[1]} ..."


def _first_frame(recorded: list[Frame], replayed: list[Frame]) -> str:
    for number, (old, new) in enumerate(zip(recorded, replayed, strict=False)):
        if old != new:
            return f"frame {number} sent was {_frame_text(old)}, is {_frame_text(new)}"
    return f"{len(recorded)} frames were sent, now {len(replayed)}"


def _frame_text(frame: Frame) -> str:
    return f"0x{frame.can_id:03x} [{frame.data.hex(' ')}]"


def _other_versions(recorded: list[Version]) -> list[str]:
    """What the recording was made with, where this program runs with something else."""
    here = {each.name: each.version for each in versions()}
    return [
        f"{each.name} {each.version} (here {here.get(each.name, 'none')})"
        for each in recorded
        if here.get(each.name) != each.version
    ]


__all__ = ["Difference", "Gap", "ReplayCheck", "RobotCheck", "check", "to_json", "to_text"]
