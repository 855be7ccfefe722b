"""What the transmit guard measures for itself from received frames, apart from the drivers."""

import math

from config.can import e2e
from config.can.database import CanDatabase
from config.can.frame import Frame
from config.fleet import Vehicle

PAIR_WITHIN_S = 0.05
"""Encoder angle and drive position this close in time belong together while the wheel stands."""


class Measured:
    """Speed, steering position and the steering drive's zero, as the bus tells them."""

    def __init__(self, database: CanDatabase, vehicle: Vehicle) -> None:
        self.speed_mps = 0.0
        self.position_rev: float | None = None
        self.zero_rev: float | None = None
        self._drive = database.axis(vehicle.drive.node).get_encoder_estimates
        self._steering = database.axis(vehicle.steering.node).get_encoder_estimates
        self._encoder = database.vehicle_aux().steering_angle
        self._encoder_ids = e2e.data_id_list(self._encoder.can_id)
        self._vehicle = vehicle
        self._angle_rad = math.nan
        self._t_angle_s = -math.inf

    def observe(self, frame: Frame, may_move: bool) -> None:
        """Take a received frame; the zero is measured only while the wheel may not move."""
        if frame.remote or len(frame.data) != 8:
            return
        if frame.can_id == self._drive.can_id:
            speed_mps = (
                self._drive.unpack(frame.data).vel_estimate
                / self._vehicle.drive.revolutions_per_unit
            )
            self.speed_mps = speed_mps if math.isfinite(speed_mps) else self.speed_mps
        elif frame.can_id == self._steering.can_id:
            position_rev = self._steering.unpack(frame.data).pos_estimate
            self.position_rev = position_rev if math.isfinite(position_rev) else None
            if not may_move:
                self._measure_zero(frame.t_s)
        elif frame.can_id == self._encoder.can_id:
            self._on_angle(frame)

    def _on_angle(self, frame: Frame) -> None:
        if not e2e.crc_ok(frame.data, self._encoder_ids):
            return
        angle = self._encoder.unpack(frame.data)
        if angle.angle_valid and angle.angle_referenced:
            self._angle_rad, self._t_angle_s = angle.angle, frame.t_s

    def _measure_zero(self, now_s: float) -> None:
        if self.position_rev is not None and now_s - self._t_angle_s <= PAIR_WITHIN_S:
            turned_rev = self._angle_rad * self._vehicle.steering.revolutions_per_unit
            self.zero_rev = self.position_rev - turned_rev
