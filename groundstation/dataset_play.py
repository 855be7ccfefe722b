"""Plays recordings to robots under virtual time and keeps what they publish."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import msgspec
import numpy as np

from config import topics
from config.fleet import Fleet
from config.messages import Message, Motion, PoseEstimate, RelativeEstimate, Status
from config.topics import Topic
from groundstation.lockstep import PlaybackLockstep, Recording

PROGRESS_PERIOD_S = 5.0
SEED = 1

Progress = Callable[[str, float], None]
"""Told a robot's name and how many seconds of its recording have been played."""


@dataclass(slots=True)
class Played:
    """What one robot has said, each with the time since the recording's start [s].

    `real_s` is what playing `seconds` of the recording took, reading the files excluded: time of
    one core in lockstep, else time of the clock.
    """

    poses: list[tuple[float, PoseEstimate]] = field(default_factory=list)
    relatives: list[tuple[float, RelativeEstimate]] = field(default_factory=list)
    statuses: list[tuple[float, Status]] = field(default_factory=list)
    motions: list[tuple[float, Motion]] = field(default_factory=list)
    seconds: float = 0.0
    real_s: float = 0.0

    @property
    def trusted_poses(self) -> list[tuple[float, PoseEstimate]]:
        """The poses that the robot would have driven on."""
        return [(t_s, pose) for t_s, pose in self.poses if pose.valid and pose.trusted]

    @property
    def trusted_from_s(self) -> float | None:
        """From when on the robot has trusted its pose until the end; None where it does not."""
        if not self.poses:
            return None
        t_s, last = self.poses[-1]
        if not last.trusted or last.trusted_since_s is None:
            return None
        return max(0.0, last.trusted_since_s - (last.t_ns * 1e-9 - t_s))

    def trusted_share(self, from_s: float) -> float:
        """Share of the time from `from_s` on in which the robot trusted a pose."""
        looks = sum(t_s >= from_s for t_s, _ in self.statuses)
        period_s = (self.seconds - from_s) / looks if looks else 0.0
        times = np.array([t_s for t_s, _ in self.trusted_poses if t_s >= from_s])
        if not len(times) or not looks:
            return 0.0
        filled = len(np.unique(np.floor((times - from_s) / period_s)))
        return min(1.0, filled / looks)

    def keep(self, t_s: float, message: Message) -> None:
        """Keep a message that is judged; relative estimates that are not valid are none."""
        if isinstance(message, PoseEstimate):
            self.poses.append((t_s, message))
        elif isinstance(message, RelativeEstimate) and message.valid:
            self.relatives.append((t_s, message))
        elif isinstance(message, Status):
            self.statuses.append((t_s, message))
        elif isinstance(message, Motion) and message.valid:
            self.motions.append((t_s, message))


def play_lockstep(
    fleet: Fleet,
    recordings: Mapping[str, Recording],
    limit_s: float,
    progress: Progress,
) -> dict[str, Played]:
    """Play recordings, by the robots' names, until one of them or `limit_s` is over."""
    decoders = {
        topic.name: msgspec.json.Decoder(topic.message)
        for topic in (topics.POSE, topics.RELATIVE, topics.STATUS, topics.MOTION)
    }
    heard: list[tuple[str, Message]] = []

    def hear(topic: Topic, name: str, body: bytes) -> None:
        decoder = decoders.get(topic.name)
        message = None if decoder is None else decoder.decode(body)
        if isinstance(message, Message):
            heard.append((name, message))

    played = {name: Played() for name in recordings}
    began_s, next_s = time.process_time(), 0.0
    with PlaybackLockstep(fleet, recordings, SEED, hear) as lockstep:
        while lockstep.played_s < limit_s and not lockstep.ended:
            lockstep.tick()
            if lockstep.played_s >= next_s:
                next_s += PROGRESS_PERIOD_S
                progress(" ".join(recordings), lockstep.played_s)
        started_s, seconds = lockstep.now_s - lockstep.played_s, lockstep.played_s
    real_s = time.process_time() - began_s
    for name, message in heard:
        played[name].keep(message.t_ns * 1e-9 - started_s, message)
    for each in played.values():
        each.seconds, each.real_s = seconds, real_s
    return played
