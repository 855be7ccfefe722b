"""Messages that Foxglove and Lichtblick draw by themselves, with the field names of their schemas.

Viewers recognise them by name (`foxglove.SceneUpdate`) and read every list of an entity, so all
lists are written, empty ones too. Lengths are metres, colours 0 to 1.
"""

import math

import msgspec


class Time(msgspec.Struct, frozen=True):
    """An instant of the wall clock, or a duration."""

    sec: int = 0
    nsec: int = 0


class Vector(msgspec.Struct, frozen=True):
    """A position, a direction or a size."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Quaternion(msgspec.Struct, frozen=True):
    """A rotation."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


class Pose(msgspec.Struct, frozen=True):
    """A place and a direction."""

    position: Vector = Vector()
    orientation: Quaternion = Quaternion()


class Colour(msgspec.Struct, frozen=True):
    """A colour and its opacity."""

    r: float
    g: float
    b: float
    a: float = 1.0


class Arrow(msgspec.Struct, frozen=True):
    """An arrow along x of its pose."""

    pose: Pose
    shaft_length: float
    shaft_diameter: float
    head_length: float
    head_diameter: float
    color: Colour


class Box(msgspec.Struct, frozen=True):
    """A box or a sphere (an ellipsoid), by its full size."""

    pose: Pose
    size: Vector
    color: Colour


class Cylinder(msgspec.Struct, frozen=True):
    """An elliptic cylinder along z of its pose."""

    pose: Pose
    size: Vector
    bottom_scale: float
    top_scale: float
    color: Colour


class Line(msgspec.Struct, frozen=True):
    """A line through points; type 0 is a strip, 1 a closed loop, 2 separate segments."""

    type: int
    pose: Pose
    thickness: float
    scale_invariant: bool
    points: list[Vector]
    color: Colour
    colors: list[Colour] = []
    indices: list[int] = []


class Triangles(msgspec.Struct, frozen=True):
    """A surface; unused here, but part of the schema."""

    pose: Pose
    points: list[Vector]
    color: Colour
    colors: list[Colour]
    indices: list[int]


class Text(msgspec.Struct, frozen=True):
    """A label that may face the camera."""

    pose: Pose
    billboard: bool
    font_size: float
    scale_invariant: bool
    color: Colour
    text: str


class Model(msgspec.Struct, frozen=True):
    """A mesh; unused here, but part of the schema."""

    pose: Pose
    scale: Vector
    color: Colour
    override_color: bool
    url: str
    media_type: str
    data: str


class KeyValue(msgspec.Struct, frozen=True):
    """A remark on an entity."""

    key: str
    value: str


class Entity(msgspec.Struct, frozen=True, kw_only=True):
    """What is drawn under one name; a new one of the same name replaces it."""

    timestamp: Time
    frame_id: str
    id: str
    lifetime: Time = Time()
    frame_locked: bool = True
    metadata: list[KeyValue] = []
    arrows: list[Arrow] = []
    cubes: list[Box] = []
    spheres: list[Box] = []
    cylinders: list[Cylinder] = []
    lines: list[Line] = []
    triangles: list[Triangles] = []
    texts: list[Text] = []
    models: list[Model] = []


class Deletion(msgspec.Struct, frozen=True):
    """Takes entities away; type 0 the one named, 1 all."""

    timestamp: Time
    type: int
    id: str


class SceneUpdate(msgspec.Struct, frozen=True):
    """Entities to draw from now on."""

    deletions: list[Deletion]
    entities: list[Entity]


class FrameTransform(msgspec.Struct, frozen=True):
    """Where a frame is in its parent."""

    timestamp: Time
    parent_frame_id: str
    child_frame_id: str
    translation: Vector
    rotation: Quaternion


class FrameTransforms(msgspec.Struct, frozen=True):
    """Where several frames are."""

    transforms: list[FrameTransform]


class Log(msgspec.Struct, frozen=True):
    """A line of the log; level 2 is info, 3 a warning, 4 an error."""

    timestamp: Time
    level: int
    message: str
    name: str
    file: str = ""
    line: int = 0


def instant(wall_ns: int) -> Time:
    """A wall time [ns] as viewers want it."""
    return Time(*divmod(wall_ns, 1_000_000_000))


def turned(angle_rad: float) -> Quaternion:
    """A rotation about z."""
    return Quaternion(z=math.sin(angle_rad / 2), w=math.cos(angle_rad / 2))
