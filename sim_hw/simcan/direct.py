"""python-can bus of one simulated robot in the same process, for runs under virtual time.

It behaves as socketcan does: a full transmit queue or a controller that is bus-off is an error on
sending, a lost adapter one on every call, and error frames are received like others.
"""

import errno
from collections import deque
from typing import Protocol

import can

from config.can.frame import Frame
from sim_hw.error_frames import ERROR_FLAG

RECEIVE_BUFFER_FRAMES = 1024
"""A host that does not read loses what comes on top; a socket holds a few hundred frames."""


class Devices(Protocol):
    """What emulates one robot's hardware on its bus."""

    @property
    def adapter_lost(self) -> bool:
        """The host has no CAN adapter at present."""

    def collect(self) -> list[Frame]:
        """What the host has heard since the last call."""

    def deliver(self, frame: Frame) -> bool:
        """Take a frame of the host; False where its transmit queue is full or it is bus-off."""


class DirectBus(can.BusABC):
    """The host's end of a robot's bus. Its wall clock is `wall_offset_s` ahead of the bus time."""

    def __init__(self, devices: Devices, name: str, t_s: float, wall_offset_s: float) -> None:
        self._devices = devices
        self._name = name
        self._now_s = t_s
        self._wall_offset_s = wall_offset_s
        self._received: deque[Frame] = deque()
        self._open = True
        self.lost = 0
        self.channel_info = f"direct {name}"
        super().__init__(channel=name)

    def update(self, now_s: float) -> None:
        """Take over what the bus has carried until `now_s`, which the devices have reached."""
        self._now_s = now_s
        frames = self._devices.collect()
        room = RECEIVE_BUFFER_FRAMES - len(self._received)
        self._received.extend(frames[:room])
        self.lost += max(0, len(frames) - room)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Next message, or None; time stands still, so there is no waiting."""
        self._check()
        if not self._received:
            return None
        frame = self._received.popleft()
        return can.Message(
            timestamp=frame.t_s + self._wall_offset_s,
            arbitration_id=frame.can_id & ~ERROR_FLAG,
            data=None if frame.remote else frame.data,
            is_extended_id=False,
            is_remote_frame=frame.remote,
            is_error_frame=bool(frame.can_id & ERROR_FLAG),
        )

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a message at the present time; raises CanOperationError where it cannot be."""
        self._check()
        data = b"" if msg.is_remote_frame else bytes(msg.data)
        if not self._devices.deliver(
            Frame(msg.arbitration_id, data, self._now_s, msg.is_remote_frame)
        ):
            raise can.CanOperationError("Transmit buffer full")

    def shutdown(self) -> None:
        """Leave the bus; may be called again."""
        super().shutdown()
        self._open = False

    def _check(self) -> None:
        if not self._open:
            raise can.CanOperationError("Cannot operate on a closed bus")
        if self._devices.adapter_lost:
            self._received.clear()
            raise can.CanOperationError(f"CAN adapter of {self._name} is gone", errno.ENODEV)
