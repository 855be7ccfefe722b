"""The exported DBC of one robot, read by cantools alone."""

import pytest
from cantools.database import load_string
from cantools.database.can import Database

from config.can.database import CanDatabase
from config.can.robot_dbc import robot_dbc


@pytest.mark.parametrize(("steering", "drive", "sensor"), [(1, 2, 0), (2, 1, 2), (62, 4, 1)])
def test_stock_tools_load_it_and_find_every_message(steering: int, drive: int, sensor: int) -> None:
    database = load_string(robot_dbc(steering, drive, sensor), "dbc", strict=True)
    assert isinstance(database, Database)
    codecs = CanDatabase.load()
    expected = {
        codec.can_id
        for group in (
            codecs.axis(steering),
            codecs.axis(drive),
            codecs.bearing_sensor(sensor),
            codecs.vehicle_aux(),
        )
        for codec in group
    }
    assert {message.frame_id for message in database.messages} == expected
    assert {"SteeringODrive", "DriveODrive", "BearingSensor", "Host"} <= {
        node.name for node in database.nodes
    }


def test_stock_tools_decode_names_values_and_choices() -> None:
    database = load_string(robot_dbc(1, 2, 1), "dbc", strict=True)
    assert isinstance(database, Database)
    heartbeat = database.decode_message(0x041, bytes.fromhex("0000000101030100"))
    assert isinstance(heartbeat, dict)
    assert str(heartbeat["Axis_State"]) == "IDLE"
    velocity = database.decode_message("Drive_Set_Input_Vel", bytes.fromhex("0000c03f00000000"))
    assert velocity == {"Input_Vel": 1.5, "Input_Torque_FF": 0.0}


def test_a_second_load_of_its_own_dump_is_equal() -> None:
    database = load_string(robot_dbc(1, 2, 0), "dbc", strict=True)
    assert isinstance(database, Database)
    again = load_string(database.as_dbc_string(), "dbc", strict=True)
    assert isinstance(again, Database)
    assert [m.name for m in again.messages] == [m.name for m in database.messages]


def test_the_nominal_bus_load_stays_below_forty_percent() -> None:
    """Worst-case stuffing at 500 kbit/s, 8 targets per camera frame."""
    database = load_string(robot_dbc(1, 2, 0), "dbc", strict=True)
    assert isinstance(database, Database)
    periods = {m.name: m.cycle_time / 1000 for m in database.messages if m.cycle_time}
    periods |= {"Steering_Set_Input_Pos": 0.01, "Drive_Set_Input_Vel": 0.01}
    periods["Brg_Target"] = periods["Brg_Frame"] / 8
    bits = {m.name: 8 * m.length + 47 + (34 + 8 * m.length - 1) // 4 for m in database.messages}
    load = sum(bits[name] / period for name, period in periods.items()) / 500_000
    assert 0.1 < load < 0.4
