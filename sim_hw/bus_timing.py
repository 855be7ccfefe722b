"""One CAN bus in bus time: bit rate, arbitration, transmit queues, errors and bus-off.

Events only: whenever the bus falls idle, the lowest identifier at the head of any node's queue is
sent; it takes as long as its bits do, and is heard at the end of the frame. Pure: time is passed in
and must not go back. Faults of the bus come from `sim_hw.bus_faults`.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from config.can.frame import Frame
from sim_hw import error_frames
from sim_hw.bus_faults import BusFaults
from sim_hw.can_controller import Controller, ErrorState
from sim_hw.frame_length import INTERFRAME_BITS, frame_bits

HOST = "host"
BABBLER = "babbler"
HOST_QUEUE_FRAMES = 10
"""As a Linux network interface for CAN has it (txqueuelen)."""
DEVICE_QUEUE_FRAMES = 64
RESTART_S = 0.1
"""From bus-off to the restart of a controller (`restart-ms 100`)."""

_ERROR_BITS = 20
"""Error flags, their echo and delimiter, instead of the end of the frame; rounded up."""


class BusLoad(NamedTuple):
    """Over the last whole second: share of the time that the bus was taken, and counts."""

    share: float = 0.0
    frames: int = 0
    errors: int = 0


class TimedBus:
    """A bus with a host, the named devices, and room for a babbling node.

    `to_host` and `to_devices` collect what went over the bus, stamped with the end of the frame;
    the caller empties them. The host gets error frames too (see `sim_hw.error_frames`).
    """

    def __init__(self, bitrate: int, t_s: float, devices: Iterable[str], faults: BusFaults) -> None:
        self.to_host: list[Frame] = []
        self.to_devices: list[Frame] = []
        self.load = BusLoad()
        self.host = Controller(HOST, HOST_QUEUE_FRAMES)
        names = (*devices, BABBLER)
        self._others = {name: Controller(name, DEVICE_QUEUE_FRAMES) for name in names}
        self._nodes = [self.host, *self._others.values()]
        self._bit_s = 1.0 / bitrate
        self._faults = faults
        self._sender: Controller | None = None
        self._damaged = False
        self._bits = 0
        self._free_s = self._next_s = t_s
        self._alone_s = t_s
        self._host_state = ErrorState.ACTIVE
        self._troubled = False
        self._restarts: dict[str, float] = {}
        self._window_s = t_s
        self._taken_bits = self._frames = self._errors = 0

    def node(self, name: str) -> Controller:
        """The controller of the host, a device or the babbler."""
        return self.host if name == HOST else self._others[name]

    def queue(self, name: str, frame: Frame) -> bool:
        """Hand a frame to a node's controller at `frame.t_s`; False where there is no room."""
        node = self.host if name == HOST else self._others[name]
        if len(node.queue) >= node.limit or name in self._restarts:
            node.overflowed += 1
            return False
        node.queue.append(frame)
        if self._sender is None:
            self._next_s = min(self._next_s, max(frame.t_s, self._free_s))
        return True

    @property
    def host_full(self) -> bool:
        """Whether the host's controller would refuse a frame now."""
        return len(self.host.queue) >= self.host.limit or HOST in self._restarts

    def advance(self, t_s: float) -> None:
        """Let everything happen that happens on the bus until `t_s`."""
        if self._faults.any or self._restarts:
            self._host_faults(t_s)
        while self._next_s <= t_s:
            if self._sender is None:
                self._arbitrate(self._next_s)
            else:
                self._finish(self._sender)
        if t_s - self._window_s >= 1.0:
            self._close_window(t_s)

    def _arbitrate(self, now_s: float) -> None:
        winner: Controller | None = None
        best, earliest_s = math.inf, math.inf
        for node in self._nodes:
            if not node.queue:
                continue
            head = node.queue[0]
            if head.t_s > now_s:
                earliest_s = min(earliest_s, head.t_s)
            elif head.can_id * 2 + head.remote < best:
                if node is self.host and self._faults.unplugged:
                    continue
                best, winner = head.can_id * 2 + head.remote, node
        if winner is None:
            self._next_s = earliest_s
            return
        self._sender = winner
        self._bits = frame_bits(winner.queue[0])
        self._damaged = self._faults.any and self._destroyed(winner)
        if self._damaged:
            self._bits += _ERROR_BITS
        self._next_s = now_s + (self._bits - INTERFRAME_BITS) * self._bit_s

    def _destroyed(self, sender: Controller) -> bool:
        """Whether the frame that begins will end in an error frame."""
        disturbs = sender is self.host or self.host.state < ErrorState.PASSIVE
        if self._faults.wrong_bitrate and disturbs:
            return True
        return self._faults.destroys(sender.queue[0])

    def _finish(self, sender: Controller) -> None:
        """The end of a frame, or of an error frame."""
        end_s = self._next_s
        self._sender = None
        self._taken_bits += self._bits
        self._free_s = end_s + INTERFRAME_BITS * self._bit_s
        self._next_s = self._free_s
        if not sender.queue:
            return
        if self._damaged:
            self._count_error(sender, end_s)
        else:
            self._frames += 1
            frame = sender.queue.popleft()
            self._hand_over(sender, Frame(frame.can_id, frame.data, end_s, frame.remote))
            if self._troubled:
                self._count_success(sender, end_s)

    def _hand_over(self, sender: Controller, frame: Frame) -> None:
        if not (self._faults.any or self._restarts):
            (self.to_devices if sender is self.host else self.to_host).append(frame)
        elif sender is self.host:
            self.to_devices += self._faults.received(True, frame)
        elif not self._host_deaf():
            self.to_host += self._faults.received(False, frame)

    def _host_deaf(self) -> bool:
        faults = self._faults
        return faults.wrong_bitrate or faults.unplugged or HOST in self._restarts

    def _host_faults(self, t_s: float) -> None:
        """What befalls controllers apart from frames: bus-off, restarts, nobody to hear."""
        if self._faults.bus_off:
            self._restarts.pop(HOST, None)
            if self.host.state is not ErrorState.BUS_OFF:
                self._go_off(self.host, t_s)
            self._restarts[HOST] = t_s + RESTART_S
        for name, due_s in list(self._restarts.items()):
            if due_s <= t_s:
                self._restart(name, t_s)
        self._alone_s = max(self._alone_s, t_s - RESTART_S)
        while self._faults.unplugged and self.host.queue and self._alone_s < t_s:
            self._alone_s += (frame_bits(self.host.queue[0]) + _ERROR_BITS) * self._bit_s
            if self.host.state < ErrorState.PASSIVE:
                self.host.not_acknowledged()
                self.to_host.append(error_frames.no_acknowledge(self.host, t_s))
                self._after_count(t_s)

    def _count_error(self, sender: Controller, t_s: float) -> None:
        self._errors += 1
        self._troubled = True
        sender.sending_failed()
        for node in self._nodes:
            if node is not sender and node.name != BABBLER and node.name not in self._restarts:
                node.hearing_failed(alone=node is self.host and self._faults.wrong_bitrate)
        if HOST not in self._restarts and not self._faults.unplugged:
            sending = sender is self.host
            self.to_host.append(error_frames.wire_error(self.host, t_s, sending=sending))
        if sender.state is ErrorState.BUS_OFF:
            self._go_off(sender, t_s)
        self._after_count(t_s)

    def _count_success(self, sender: Controller, t_s: float) -> None:
        sender.sent()
        for node in self._nodes:
            if node is not sender and not (node is self.host and self._host_deaf()):
                node.heard()
        self._troubled = any(node.troubled for node in self._nodes)
        self._after_count(t_s)

    def _after_count(self, t_s: float) -> None:
        self._troubled = self._troubled or self.host.troubled
        state = self.host.state
        if state is not self._host_state:
            self._host_state = state
            self.to_host.append(error_frames.state_changed(self.host, t_s))

    def _go_off(self, node: Controller, t_s: float) -> None:
        node.go_off()
        self._troubled = True
        self._restarts[node.name] = t_s + RESTART_S
        self._after_count(t_s)

    def _restart(self, name: str, t_s: float) -> None:
        del self._restarts[name]
        self.node(name).restart()
        if name == HOST:
            self._host_state = ErrorState.ACTIVE
            self.to_host.append(error_frames.restarted(self.host, t_s))

    def is_off(self, name: str) -> bool:
        """Whether a node's controller is bus-off: it neither sends nor hears."""
        return name in self._restarts

    def _close_window(self, t_s: float) -> None:
        share = self._taken_bits * self._bit_s / (t_s - self._window_s)
        self.load = BusLoad(share, self._frames, self._errors)
        self._window_s = t_s
        self._taken_bits = self._frames = self._errors = 0
