"""What the host sends of itself: periods, counters and content."""

import struct

from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.vehicle import EstopSource, HostState
from onboard.canbus.host import BearingOrders, HostFrames
from tests.onboard.canbus.fakes import signed

TIMES_S = [round(0.01 * step, 6) for step in range(100)]


def test_the_heartbeat_comes_each_50_ms_and_counts(database: CanDatabase) -> None:
    host = HostFrames(database.vehicle_aux())
    sent = [frame for now_s in TIMES_S for frame in host.tick(now_s, HostState.READY)]
    assert [frame.t_s for frame in sent] == TIMES_S[::5]
    assert {frame.can_id for frame in sent} == {0x012}
    assert [frame.data[1] & 0x0F for frame in sent] == [*range(16), *range(4)]


def test_the_heartbeat_tells_state_and_clock(database: CanDatabase) -> None:
    (frame,) = HostFrames(database.vehicle_aux()).tick(6.5536 + 0.25, HostState.STOPPING)
    body = bytes((HostState.STOPPING << 4,)) + struct.pack("<H", 2500)
    assert frame == Frame(0x012, signed(0x012, body, 0), 6.8036)


def test_an_estop_goes_out_at_once_and_is_repeated(database: CanDatabase) -> None:
    host = HostFrames(database.vehicle_aux())
    host.tick(0.0, HostState.ACTIVE)
    sent = [
        frame
        for now_s in TIMES_S[1:12]
        for frame in host.tick(now_s, HostState.FAULT, EstopSource.NETWORK)
        if frame.can_id == 0x010
    ]
    assert [frame.t_s for frame in sent] == [0.01, 0.06, 0.11]
    active_by_network = bytes((1 << 4 | EstopSource.NETWORK << 5,))
    assert sent[0].data == signed(0x010, active_by_network, 0)


def test_missed_periods_are_skipped_not_caught_up(database: CanDatabase) -> None:
    host = HostFrames(database.vehicle_aux())
    times_s = [0.0, 0.27, 0.28, 0.29, 0.30, 0.31]
    sent = [frame.t_s for now_s in times_s for frame in host.tick(now_s, HostState.READY)]
    assert sent == [0.0, 0.27, 0.30]


def test_orders_to_the_sensor_come_each_100_ms(database: CanDatabase) -> None:
    orders = BearingOrders(database.bearing_sensor(1), rate_hz=50.0)
    sent = [frame for now_s in TIMES_S for frame in orders.tick(now_s)]
    assert [frame.t_s for frame in sent] == TIMES_S[::10]
    body = bytes((2 << 4, 8 | 0b11 << 5, 100, 0, 0)) + struct.pack("<H", 1000)
    assert sent[1].data == signed(0x143, body, 1)
