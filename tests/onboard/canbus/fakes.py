"""Hand-written frames of devices, packed here byte by byte and not by the software under test."""

import struct

from config.can.frame import Frame

IDLE_HEARTBEAT = bytes.fromhex("0000000001000100")
ACTIVE_HEARTBEAT = bytes.fromhex("0000000008010000")
WATCHDOG_HEARTBEAT = bytes.fromhex("0000000101030100")


class FakeDrive:
    """Sends a heartbeat each 100 ms and estimates each 10 ms, as told, and nothing by itself."""

    def __init__(self, node: int) -> None:
        self.node = node
        self.heartbeat: bytes | None = IDLE_HEARTBEAT
        self.position_rev = 0.0
        self.velocity_rps = 0.0
        self.sends_estimates = True
        self._next_heartbeat_s = 0.0

    def frames(self, now_s: float) -> list[Frame]:
        """What the drive sends in the cycle that ends at `now_s`."""
        frames = []
        if self.heartbeat is not None and now_s >= self._next_heartbeat_s - 1e-9:
            frames.append(Frame(self.node << 5 | 0x01, self.heartbeat, now_s))
            self._next_heartbeat_s = now_s + 0.1
        if self.sends_estimates:
            frames.append(estimates(self.node, self.position_rev, self.velocity_rps, now_s))
        return frames


def estimates(node: int, position_rev: float, velocity_rps: float, t_s: float) -> Frame:
    """Get_Encoder_Estimates of a drive."""
    return Frame(node << 5 | 0x09, struct.pack("<ff", position_rev, velocity_rps), t_s)


def signed(can_id: int, body: bytes, counter: int) -> bytes:
    """A profile 2 frame computed bit by bit: `body` is the payload from byte 1 on."""
    low, high = can_id & 0xFF, can_id >> 8
    identity = (low + 17 * counter + high * (2 * counter + 1)) & 0xFF
    covered = bytes((body[0] & 0xF0 | counter,)) + body[1:]
    value = 0xFF
    for byte in covered + bytes((identity,)):
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x2F if value & 0x80 else value << 1) & 0xFF
    return bytes((value ^ 0xFF,)) + covered


def steering_angle(angle_rad: float, counter: int, t_s: float, flags: int = 0x30) -> Frame:
    """SteerEnc_Angle; flags: 0x10 valid, 0x20 referenced, 0x40 magnet, 0x80 internal fault."""
    body = bytes((flags,)) + struct.pack("<hhH", round(angle_rad / 1e-4), 250, 0)
    return Frame(0x060, signed(0x060, body, counter), t_s)


def bearing_header(
    n_targets: int,
    counter: int,
    t_s: float,
    *,
    capture: int = 77,
    version: int = 1,
    latency_raw: int = 417,
) -> Frame:
    """Brg_Frame of sensor 0, valid and synchronised."""
    body = bytes((version << 4, capture, n_targets | 0xC0)) + struct.pack("<HH", latency_raw, 0)
    return Frame(0x120, signed(0x120, body, counter), t_s)


def bearing_target(
    slot: int,
    bearing_rad: float,
    counter: int,
    t_s: float,
    *,
    capture: int = 77,
    target: int = 13,
    quality: int = 12,
) -> Frame:
    """Brg_Target of sensor 0: a robot seen with 4 mrad standard deviation."""
    packed = target | 1 << 10 | quality << 12
    body = bytes((slot << 4, capture)) + struct.pack("<HhB", packed, round(bearing_rad / 1e-4), 8)
    return Frame(0x121, signed(0x121, body, counter), t_s)


def bearing_health(counter: int, t_s: float, state: int = 2, faults: int = 0) -> Frame:
    """Brg_Health of sensor 0."""
    body = bytes((state << 4, 251, 200, 30, faults, 0, 1))
    return Frame(0x122, signed(0x122, body, counter), t_s)
