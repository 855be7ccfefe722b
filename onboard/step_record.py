"""One step as messages, losslessly, and back: what a replay through the same code needs.

JSON keeps every bit of a finite double, and nothing that enters a step is anything else.
"""

import platform
import zlib
from importlib.metadata import version

from config import topics
from config.can.frame import Frame
from config.fleet import Fleet
from config.messages import (
    CanFrame,
    Message,
    RobotStart,
    StepRecord,
    StepReply,
    StepRequest,
    Version,
    encode,
)
from config.topics import Topic
from onboard.step import Inputs, Outputs, Request

LIBRARIES = ("echelon", "numpy", "msgspec", "python-can", "eclipse-zenoh")
START_EVERY_STEPS = 1000


class StepRecorder:
    """Numbers the steps of one robot and makes their record."""

    def __init__(self, fleet: Fleet, name: str, seed: int) -> None:
        self._name, self._seed = name, seed
        self._fleet_json = fleet.model_dump_json()
        self._versions = versions()
        self._steps = 0

    def messages(self, inputs: Inputs, outputs: Outputs) -> list[tuple[Topic, Message]]:
        """The record of the next step; its first message tells what the robot runs with."""
        seq, name = self._steps, self._name
        t_ns, wall_ns = round(inputs.now_s * 1e9), round(inputs.wall_s * 1e9)
        self._steps += 1
        record: list[tuple[Topic, Message]] = []
        if seq % START_EVERY_STEPS == 0:
            start = RobotStart(
                seq=seq // START_EVERY_STEPS,
                t_ns=t_ns,
                wall_ns=wall_ns,
                robot=name,
                seed=self._seed,
                fleet_json=self._fleet_json,
                versions=self._versions,
            )
            record.append((topics.ROBOT_START, start))
        frames = [
            *[CanFrame(each[0], each[1].hex(), each[2], False, each[3]) for each in inputs.frames],
            *[CanFrame(each[0], each[1].hex(), each[2], True, each[3]) for each in outputs.frames],
        ]
        step = StepRecord(
            seq=seq,
            t_ns=t_ns,
            wall_ns=wall_ns,
            robot=name,
            now_s=inputs.now_s,
            wall_s=inputs.wall_s,
            late_s=inputs.late_s,
            bus=inputs.bus,
            loop=inputs.loop,
            frames=frames,
            motions=inputs.motions,
            requests=[StepRequest(*request) for request in inputs.requests],
            estops=inputs.estops,
            grounds=inputs.grounds,
            unreadable=inputs.unreadable,
            notes=inputs.notes,
            shutdown=inputs.shutdown,
            free_disk_mb=inputs.free_disk_mb,
            replies=[StepReply(*reply) for reply in outputs.replies],
            messages_crc=messages_crc(outputs),
        )
        record.append((topics.STEP, step))
        return record


def inputs_of(record: StepRecord) -> Inputs:
    """The inputs of the recorded step."""
    return Inputs(
        now_s=record.now_s,
        wall_s=record.wall_s,
        frames=[_frame(each) for each in record.frames if not each.sent],
        bus=record.bus,
        loop=record.loop,
        late_s=record.late_s,
        motions=record.motions,
        requests=[Request(each.number, each.command) for each in record.requests],
        estops=record.estops,
        grounds=record.grounds,
        unreadable=record.unreadable,
        notes=record.notes,
        shutdown=record.shutdown,
        free_disk_mb=record.free_disk_mb,
    )


def sent_frames(record: StepRecord) -> list[Frame]:
    """The frames that the recorded step put out."""
    return [_frame(each) for each in record.frames if each.sent]


def messages_crc(outputs: Outputs) -> int:
    """CRC-32 of the encoded messages of a step, in their order."""
    crc = 0
    for _, message in outputs.messages:
        crc = zlib.crc32(encode(message), crc)
    return crc


def versions() -> list[Version]:
    """This program, its libraries and the machine: what the last bit of a result may hang on."""
    return [
        *(Version(name, version(name)) for name in LIBRARIES),
        Version("python", platform.python_version()),
        Version("machine", f"{platform.system()} {platform.machine()}"),
    ]


def _frame(recorded: CanFrame) -> Frame:
    return Frame(recorded.id, bytes.fromhex(recorded.data), recorded.t_s, recorded.remote)
