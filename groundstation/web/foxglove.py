"""The Foxglove WebSocket protocol, version 1: every message of the fleet, and its frames.

Foxglove and Lichtblick connect to `ws://HOST:PORT/foxglove`. Channels have the key expression as
topic and the JSON that is on the wire as payload; `tf` moves labelled axes in their 3D panel
without any setting. Clients may subscribe only: nothing can be commanded from there.
"""

import asyncio
import math
import struct
from collections import deque
from collections.abc import Iterable
from importlib.resources import files

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect

from config import topics
from config.fleet import Fleet
from groundstation import keys
from groundstation.heard import Heard
from groundstation.json_schema import inlined_schema
from groundstation.web.wire import RobotFrame

SUBPROTOCOLS = ("foxglove.websocket.v1", "foxglove.sdk.v1")
BACKLOG = 2000
"""Messages that wait for a slow viewer; beyond them the oldest are dropped."""
TRANSFORMS = "tf"
WORLD = "map"
_HEAD = struct.Struct("<BIQ")
_MESSAGE_DATA = 1


class Channel(msgspec.Struct, frozen=True, rename="camel"):
    """One row of an advertisement."""

    id: int
    topic: str
    encoding: str
    schema_name: str
    schema: str
    schema_encoding: str


class _Subscription(msgspec.Struct, rename="camel"):
    id: int
    channel_id: int


class _FromViewer(msgspec.Struct, rename="camel"):
    op: str
    subscriptions: list[_Subscription] = []
    subscription_ids: list[int] = []


class Viewer:
    """One connected Foxglove or Lichtblick."""

    def __init__(self) -> None:
        self.waiting: deque[bytes] = deque(maxlen=BACKLOG)
        self.wake = asyncio.Event()
        self._subscriptions: dict[int, int] = {}

    def handle(self, text: str) -> str | None:
        """Take an operation; returns what is wrong with it."""
        try:
            asked = msgspec.json.decode(text, type=_FromViewer)
        except msgspec.MsgspecError as error:
            return f"this message cannot be read: {error}"
        if asked.op == "subscribe":
            self._subscriptions |= {each.channel_id: each.id for each in asked.subscriptions}
        elif asked.op == "unsubscribe":
            gone = set(asked.subscription_ids)
            kept = {c: s for c, s in self._subscriptions.items() if s not in gone}
            self._subscriptions = kept
        else:
            return f"this server knows subscribe and unsubscribe, not {asked.op!r}"
        return None

    def offer(self, channel: int, time_ns: int, payload: bytes) -> None:
        """Queue a message where the viewer wants it."""
        subscription = self._subscriptions.get(channel)
        if subscription is not None:
            self.waiting.append(_HEAD.pack(_MESSAGE_DATA, subscription, time_ns) + payload)
            self.wake.set()


class FoxgloveServer:
    """Channels of one fleet and the viewers that are connected."""

    def __init__(self, fleet: Fleet, prefix: str = "") -> None:
        self._fleet, self._prefix = fleet, prefix
        self._viewers: set[Viewer] = set()
        self.channels = [*_channels(fleet, prefix)]
        self._ids = {channel.topic: channel.id for channel in self.channels}

    @property
    def watched(self) -> bool:
        """Whether any viewer is connected."""
        return bool(self._viewers)

    def hear(self, messages: Iterable[Heard]) -> None:
        """Hand messages on to the viewers."""
        if not self._viewers:
            return
        for heard in messages:
            channel = self._ids.get(heard.key)
            if channel is not None:
                for viewer in self._viewers:
                    viewer.offer(channel, heard.message.wall_ns, heard.payload)

    def show(self, now_s: float, robots: list[RobotFrame]) -> None:
        """Hand the robots' places on as transforms."""
        if self._viewers:
            payload = msgspec.json.encode(transforms(self._fleet, now_s, robots))
            for viewer in self._viewers:
                viewer.offer(self._ids[TRANSFORMS], round(now_s * 1e9), payload)

    async def serve(self, websocket: WebSocket) -> None:
        """One viewer, from its handshake to its end."""
        offered = websocket.scope.get("subprotocols", [])
        chosen = next((each for each in SUBPROTOCOLS if each in offered), None)
        if chosen is None:
            await websocket.close(1002, f"subprotocol {SUBPROTOCOLS[0]} is needed")
            return
        await websocket.accept(subprotocol=chosen)
        viewer = Viewer()
        await websocket.send_text(_text(self._server_info()))
        advertisement = {"op": "advertise", "channels": self.channels}
        await websocket.send_text(_text(advertisement))
        self._viewers.add(viewer)
        sender = asyncio.create_task(_send(websocket, viewer))
        try:
            while True:
                problem = viewer.handle(await websocket.receive_text())
                if problem is not None:
                    await websocket.send_text(
                        _text({"op": "status", "level": 1, "message": problem})
                    )
        except (WebSocketDisconnect, KeyError):
            pass
        finally:
            self._viewers.discard(viewer)
            sender.cancel()

    def _server_info(self) -> dict[str, object]:
        name = f"echelon, fleet {self._fleet.name}"
        return {"op": "serverInfo", "name": name, "capabilities": [], "metadata": {}}


async def _send(websocket: WebSocket, viewer: Viewer) -> None:
    while True:
        await viewer.wake.wait()
        viewer.wake.clear()
        while viewer.waiting:
            await websocket.send_bytes(viewer.waiting.popleft())


def _text(message: object) -> str:
    return msgspec.json.encode(message).decode()


def _channels(fleet: Fleet, prefix: str) -> Iterable[Channel]:
    found: dict[str, topics.Topic] = {}
    for topic in topics.WATCHED:
        for robot in fleet.robots:
            found.setdefault(prefix + topic.key(fleet.name, robot), topic)
    for number, (key, topic) in enumerate(found.items(), start=1):
        assert keys.parse(key.removeprefix(prefix)).topic is topic
        name = f"echelon.{topic.message.__name__}"
        schema = inlined_schema(topic.message).decode()
        yield Channel(number, key, "json", name, schema, "jsonschema")
    schema = files("groundstation.web").joinpath("frame_transforms.json").read_text("utf-8")
    yield Channel(
        len(found) + 1, TRANSFORMS, "json", "foxglove.FrameTransforms", schema, "jsonschema"
    )


def transforms(fleet: Fleet, now_s: float, robots: list[RobotFrame]) -> dict[str, object]:
    """A `foxglove.FrameTransforms` message: estimated and true places in the landmark frame."""
    seconds, nanoseconds = divmod(round(now_s * 1e9), 1_000_000_000)
    stamp = {"sec": seconds, "nsec": nanoseconds}
    placed = [
        (name + suffix, at)
        for name, robot in zip(fleet.robots, robots, strict=True)
        for suffix, at in (("", robot.pose), ("/truth", robot.truth))
        if at is not None
    ]
    return {
        "transforms": [
            {
                "timestamp": stamp,
                "parent_frame_id": WORLD,
                "child_frame_id": frame,
                "translation": {"x": at[0], "y": at[1], "z": 0.0},
                "rotation": _rotation(at[2] or 0.0),
            }
            for frame, at in placed
        ]
    }


def _rotation(heading_rad: float) -> dict[str, float]:
    """The quaternion of a turn about the vertical."""
    return {"x": 0.0, "y": 0.0, "z": math.sin(heading_rad / 2), "w": math.cos(heading_rad / 2)}
