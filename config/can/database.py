"""The CAN database of a robot: DBC templates, moved to the robot's nodes."""

from dataclasses import dataclass
from importlib import resources
from typing import Self

from cantools.database.can import Database

from config.can.group import DatabaseMismatch, GroupT, build_group
from config.can.odrive import AxisCodecs
from config.can.odrive_05 import Axis05Codecs
from config.can.plan import IDS_PER_NODE
from config.can.vehicle import BearingSensorCodecs, VehicleAuxCodecs

__all__ = ["CanDatabase", "DatabaseMismatch", "template_text"]

AXIS_DBC = "odrive_axis.dbc"
AXIS_05_DBC = "odrive_axis_05.dbc"
BEARING_SENSOR_DBC = "bearing_sensor.dbc"
VEHICLE_AUX_DBC = "vehicle_aux.dbc"


def template_text(dbc: str) -> str:
    """Text of one of the DBC templates."""
    return resources.files("config.can").joinpath(dbc).read_text(encoding="ascii")


@dataclass(frozen=True, slots=True)
class CanDatabase:
    """Compiled templates; `axis`, `bearing_sensor` and `vehicle_aux` give codecs with real ids."""

    _axis: AxisCodecs
    _bearing_sensor: BearingSensorCodecs
    _vehicle_aux: VehicleAuxCodecs
    _axis_05: Axis05Codecs

    @classmethod
    def load(cls) -> Self:
        """Read and compile the shipped templates. Raises DatabaseMismatch."""
        return cls.from_texts(
            template_text(AXIS_DBC),
            template_text(BEARING_SENSOR_DBC),
            template_text(VEHICLE_AUX_DBC),
        )

    @classmethod
    def from_texts(cls, axis: str, bearing_sensor: str, vehicle_aux: str) -> Self:
        """Compile templates given as DBC text. Raises DatabaseMismatch."""
        return cls(
            _compile(AxisCodecs, axis, AXIS_DBC),
            _compile(BearingSensorCodecs, bearing_sensor, BEARING_SENSOR_DBC),
            _compile(VehicleAuxCodecs, vehicle_aux, VEHICLE_AUX_DBC),
            _compile(Axis05Codecs, template_text(AXIS_05_DBC), AXIS_05_DBC),
        )

    def axis(self, node: int) -> AxisCodecs:
        """Codecs of the drive with this node id."""
        return self._axis.moved(node * IDS_PER_NODE)

    def axis_05(self, node: int) -> Axis05Codecs:
        """What is different on the drive with this node id where its firmware is 0.5."""
        return self._axis_05.moved(node * IDS_PER_NODE)

    def bearing_sensor(self, unit: int = 0) -> BearingSensorCodecs:
        """Codecs of the bearing sensor with this unit number."""
        return self._bearing_sensor.moved(unit * IDS_PER_NODE)

    def vehicle_aux(self) -> VehicleAuxCodecs:
        """Codecs of the e-stop chain, the host's heartbeat and the steering encoder."""
        return self._vehicle_aux


def _compile(group: type[GroupT], text: str, dbc: str) -> GroupT:
    database = Database(strict=True)
    try:
        database.add_dbc_string(text)
    except Exception as error:  # cantools lets its parser's and its own look-up errors through
        raise DatabaseMismatch(f"{dbc}: cannot be read: {error!r}") from error
    return build_group(group, database, dbc)
