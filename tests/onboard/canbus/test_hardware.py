"""The devices of one robot behind one face."""

import math

import pytest

from config.angles import wrap
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.can.odrive import GetEncoderEstimates
from config.can.vehicle import SteeringAngle
from config.loader import load_fleet, shipped_fleet_path
from onboard.canbus.protection import Protector
from onboard.hardware import Hardware

PERIOD_S = 0.01
RATE_RADPS = 2.0


def test_a_fork_that_turns_all_the_way_round_has_a_steady_rate() -> None:
    robot = load_fleet(shipped_fleet_path("demo")).fleet.robots["r1"]
    database = CanDatabase.load()
    hardware = Hardware(robot, database)
    encoder = database.vehicle_aux().steering_angle
    estimates = database.axis(robot.vehicle.drive.node).get_encoder_estimates
    protector = Protector(encoder.can_id)
    rates = []
    for tick in range(400):
        now_s = tick * PERIOD_S
        angle = SteeringAngle(1, 1, 0, 0, wrap(RATE_RADPS * now_s), RATE_RADPS, 0.0)
        frames = [
            Frame(encoder.can_id, protector.protect(encoder.pack(*angle)), now_s),
            Frame(estimates.can_id, estimates.pack(*GetEncoderEstimates(0.0, 0.0)), now_s),
        ]
        hardware.take(frames, PERIOD_S)
        odometry = hardware.odometry(now_s)
        if odometry is not None:
            rates.append(odometry.steering_rate_radps)
    turned_rad = RATE_RADPS * 400 * PERIOD_S
    assert turned_rad > math.pi
    assert len(rates) > 390
    assert rates[1:] == pytest.approx([RATE_RADPS] * (len(rates) - 1), abs=2 * 0.0001 / PERIOD_S)
