"""The formation as a scene for Foxglove and Lichtblick, made from the fleet's own messages.

Frames: `map` holds the landmarks, `r2` is where robot r2 believes to be (followers through the
chain of estimates up to the leader), `truth/r2` where simulated hardware really is.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np

from config import topics
from config.fleet import Fleet, Robot
from config.messages import Event, PoseEstimate, RelativeEstimate, Truth
from groundstation.keys import Address
from groundstation.viewer_messages import (
    Arrow,
    Box,
    Colour,
    Cylinder,
    Entity,
    FrameTransform,
    FrameTransforms,
    Line,
    Log,
    Pose,
    SceneUpdate,
    Text,
    Time,
    Vector,
    instant,
    turned,
)

MAP = "map"
TF, SCENE, LOG = "tf", "scene", "log"
CHANNELS: dict[str, type[msgspec.Struct]] = {TF: FrameTransforms, SCENE: SceneUpdate, LOG: Log}
"""Topics that this module writes, and their types."""
FRAME_PERIOD_NS, SCENE_PERIOD_NS = 40_000_000, 200_000_000
STATIC_EVERY = 5
TWO_SIGMA_95 = 2.4477
"""Of a plane normal distribution, 95 % lie within so many standard deviations."""
LEVELS = {"info": 2, "warning": 3, "error": 4}
MARK, TRUE, WANTED = Colour(0.95, 0.76, 0.31), Colour(0.5, 0.5, 0.5, 0.6), Colour(1, 1, 1, 0.25)
COLOURS = (
    Colour(0.26, 0.53, 0.96),
    Colour(0.86, 0.27, 0.36),
    Colour(0.16, 0.65, 0.56),
    Colour(0.93, 0.65, 0.23),
    Colour(0.56, 0.42, 0.75),
    Colour(0.45, 0.62, 0.24),
)


class Drawn(NamedTuple):
    """A message for viewers, on the topic of that name."""

    topic: str
    message: msgspec.Struct


class Scene:
    """Hears the fleet's messages and makes those of the viewers, at their own lower rates."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._decoders = {
            topic.name: msgspec.json.Decoder(topic.message)
            for topic in (topics.TRUTH, topics.POSE, topics.RELATIVE, topics.EVENT)
        }
        self._heard_ns: dict[tuple[str, str], int] = {}
        self._places: dict[str, FrameTransform] = {}
        self._beliefs: dict[str, PoseEstimate | RelativeEstimate] = {}
        self._scene_ns: int | None = None
        self._scenes = 0

    def hear(self, address: Address, payload: bytes, wall_ns: int) -> Iterator[Drawn]:
        """What to draw after this message. One that cannot be read draws nothing."""
        decoder = self._decoders.get(address.topic.name)
        if decoder is None or not self._due(address, wall_ns):
            return
        try:
            message = decoder.decode(payload)
        except msgspec.MsgspecError:
            return
        if isinstance(message, Event):
            yield Drawn(LOG, _log(message))
        elif isinstance(message, Truth | PoseEstimate | RelativeEstimate) and message.valid:
            frames = self._frames(address.robot, message)
            if frames:
                yield Drawn(TF, FrameTransforms(frames))
            yield from self._scene(wall_ns)

    def _due(self, address: Address, wall_ns: int) -> bool:
        """Events always count; of anything else 25 a second do."""
        if address.topic is topics.EVENT:
            return True
        key = (address.topic.name, address.robot)
        last_ns = self._heard_ns.get(key)
        if last_ns is not None and wall_ns - last_ns < FRAME_PERIOD_NS:
            return False
        self._heard_ns[key] = wall_ns
        return True

    def _frames(
        self, robot: str, message: Truth | PoseEstimate | RelativeEstimate
    ) -> list[FrameTransform]:
        stamp = instant(message.wall_ns)
        if isinstance(message, Truth):
            return [
                _frame(stamp, MAP, f"truth/{robot}", message.x_m, message.y_m, message.heading_rad)
            ]
        self._beliefs[robot] = message
        if isinstance(message, PoseEstimate):
            return [_frame(stamp, MAP, robot, message.x_m, message.y_m, message.heading_rad)]
        # Seen from the leader: back along the line of sight, turned by the relative heading.
        towards = message.bearing_rad - message.heading_rad
        x_m = -message.range_m * math.cos(towards)
        y_m = -message.range_m * math.sin(towards)
        return [_frame(stamp, message.leader, robot, x_m, y_m, -message.heading_rad)]

    def _scene(self, wall_ns: int) -> Iterator[Drawn]:
        if self._scene_ns is not None and wall_ns - self._scene_ns < SCENE_PERIOD_NS:
            return
        self._scene_ns = wall_ns
        stamp = instant(wall_ns)
        entities = [
            _uncertainty(stamp, name, self._colour(name), belief)
            for name, belief in self._beliefs.items()
        ]
        if self._scenes % STATIC_EVERY == 0:
            entities += self._static(stamp)
        self._scenes += 1
        yield Drawn(SCENE, SceneUpdate([], entities))

    def _static(self, stamp: Time) -> list[Entity]:
        """What moves with its frame only: sent again each second for those who seek."""
        entities = [
            Entity(
                timestamp=stamp,
                frame_id=MAP,
                id="landmarks",
                spheres=[
                    Box(_at(mark.x_m, mark.y_m), Vector(0.3, 0.3, 0.3), MARK)
                    for mark in self._fleet.landmarks
                ],
                texts=[
                    _label(_at(mark.x_m, mark.y_m, 0.4), str(mark.id), MARK)
                    for mark in self._fleet.landmarks
                ],
            )
        ]
        true = {address for topic, address in self._heard_ns if topic == topics.TRUTH.name}
        for name, robot in self._fleet.robots.items():
            entities.append(_car(stamp, name, name, robot, self._colour(name)))
            if name in true:
                entities.append(_car(stamp, f"truth/{name}", f"truth/{name}", robot, TRUE))
            if robot.leader is not None and robot.offset is not None:
                place = _at(robot.offset.x_m, robot.offset.y_m, 0.01)
                size = Vector(0.3, 0.3, 0.02)
                entities.append(
                    Entity(
                        timestamp=stamp,
                        frame_id=robot.leader,
                        id=f"{name} wanted",
                        cylinders=[Cylinder(place, size, 1.0, 1.0, WANTED)],
                    )
                )
        return entities

    def _colour(self, name: str) -> Colour:
        return COLOURS[list(self._fleet.robots).index(name) % len(COLOURS)]


def _frame(
    stamp: Time, parent: str, child: str, x_m: float, y_m: float, angle_rad: float
) -> FrameTransform:
    return FrameTransform(stamp, parent, child, Vector(x_m, y_m), turned(angle_rad))


def _car(stamp: Time, frame: str, name: str, robot: Robot, colour: Colour) -> Entity:
    """A body from the rear axle to the front wheel, which is the frame's origin, and its name."""
    length_m = robot.vehicle.wheelbase_m
    body = Vector(length_m, 0.6 * length_m, 0.3 * length_m)
    ahead = Arrow(Pose(), 0.4 * length_m, 0.1 * length_m, 0.25 * length_m, 0.25 * length_m, colour)
    return Entity(
        timestamp=stamp,
        frame_id=frame,
        id=name,
        cubes=[Box(_at(-0.5 * length_m, 0.0, 0.15 * length_m), body, colour)],
        arrows=[ahead],
        texts=[_label(_at(0.0, 0.0, 0.8 * length_m), name, colour)],
    )


def _uncertainty(
    stamp: Time, name: str, colour: Colour, belief: PoseEstimate | RelativeEstimate
) -> Entity:
    """Where the robot, or its leader, is with 95 % probability, and the line of sight."""
    thin = Colour(colour.r, colour.g, colour.b, 0.35)
    if isinstance(belief, PoseEstimate):
        c = belief.covariance
        values, vectors = np.linalg.eigh(np.array([[c[0], c[1]], [c[4], c[5]]]))
        angle_rad = math.atan2(float(vectors[1, 1]), float(vectors[0, 1]))
        size = _ellipse(float(values[1]), float(values[0]))
        pose = Pose(Vector(belief.x_m, belief.y_m, 0.005), turned(angle_rad))
        disc = Cylinder(pose, size, 1.0, 1.0, thin)
        return Entity(timestamp=stamp, frame_id=MAP, id=f"{name} 95 %", cylinders=[disc])
    x_m = belief.range_m * math.cos(belief.bearing_rad)
    y_m = belief.range_m * math.sin(belief.bearing_rad)
    size = _ellipse(belief.covariance[0], belief.range_m**2 * belief.covariance[5])
    pose = Pose(Vector(x_m, y_m, 0.005), turned(belief.bearing_rad))
    sight = Line(0, Pose(), 1.5, True, [Vector(), Vector(x_m, y_m)], thin)
    return Entity(
        timestamp=stamp,
        frame_id=name,
        id=f"{name} 95 %",
        cylinders=[Cylinder(pose, size, 1.0, 1.0, thin)],
        lines=[sight],
    )


def _ellipse(along_m2: float, across_m2: float) -> Vector:
    """Full size of the 95 % ellipse of two variances, as a thin disc."""
    along, across = (2 * TWO_SIGMA_95 * math.sqrt(max(v, 0.0)) for v in (along_m2, across_m2))
    return Vector(along, across, 0.01)


def _label(pose: Pose, text: str, colour: Colour) -> Text:
    return Text(pose, True, 12.0, True, colour, text)


def _at(x_m: float, y_m: float, z_m: float = 0.0) -> Pose:
    return Pose(Vector(x_m, y_m, z_m))


def _log(event: Event) -> Log:
    level = LEVELS.get(event.severity, LEVELS["info"])
    return Log(instant(event.wall_ns), level, event.text, event.source)
