"""The one registry of Zenoh topics: key, message type, rate, staleness, recording.

Keys are `echelon/<fleet>/<robot>/<topic>`. Truth lives in a tree of its own,
`truth/<fleet>/<robot>/pose`, so that no key expression of a robot can reach it, and so do the
buses and faults of simulated hardware: `sim/<fleet>/<robot>/<topic>`.
"""

from dataclasses import dataclass

import msgspec

from config import messages


@dataclass(frozen=True, slots=True)
class Topic:
    """One row of the registry; `rate_hz` 0 means on change, `stale_after_s` 0 means never."""

    name: str
    template: str
    message: type[msgspec.Struct]
    rate_hz: float = 0.0
    stale_after_s: float = 0.0
    recorded: bool = True

    @property
    def per_robot(self) -> bool:
        """Whether every robot has a key of its own, and with it one publisher."""
        return "{robot}" in self.template

    def key(self, fleet: str, robot: str = "*") -> str:
        """Key expression of this topic for one robot, or for all of them."""
        return self.template.format(fleet=fleet, robot=robot)


MOTION = Topic("motion", "echelon/{fleet}/{robot}/motion", messages.Motion, 100.0, 0.2)
POSE = Topic("pose", "echelon/{fleet}/{robot}/pose", messages.PoseEstimate, 50.0, 0.2)
RELATIVE = Topic(
    "relative", "echelon/{fleet}/{robot}/relative", messages.RelativeEstimate, 50.0, 0.2
)
STATUS = Topic("status", "echelon/{fleet}/{robot}/status", messages.Status, 10.0, 0.5)
EVENT = Topic("event", "echelon/{fleet}/{robot}/event", messages.Event)
ESTOP = Topic("estop", "echelon/{fleet}/all/estop", messages.Estop)
GROUND = Topic("ground", "echelon/{fleet}/all/ground", messages.Ground, 10.0, 0.5, False)
IN_COMMAND = Topic("in_command", "echelon/{fleet}/all/in_command", messages.InCommand, 1.0, 3.0)
COMMAND = Topic("command", "echelon/{fleet}/{robot}/command", messages.Command, recorded=False)
TRUTH = Topic("truth", "truth/{fleet}/{robot}/pose", messages.Truth, 100.0, 0.2)

OBSERVABILITY = Topic(
    "observability", "echelon/{fleet}/{robot}/observability", messages.Observability, 5.0, 1.0
)

BEARINGS = Topic("bearings", "echelon/{fleet}/{robot}/bearings", messages.Bearings, 10.0, 0.5)
PARTICLES = Topic("particles", "echelon/{fleet}/{robot}/particles", messages.Particles, 2.0, 2.0)
STEP = Topic("step", "echelon/{fleet}/{robot}/step", messages.StepRecord, 100.0, 0.5)
ROBOT_START = Topic("start", "echelon/{fleet}/{robot}/start", messages.RobotStart, 0.1)

ROBOTS_OWN: tuple[Topic, ...] = (
    MOTION,
    POSE,
    RELATIVE,
    STATUS,
    EVENT,
    OBSERVABILITY,
    BEARINGS,
    PARTICLES,
)
"""What every robot tells the fleet and the operator."""
STEP_RECORD: tuple[Topic, ...] = (STEP, ROBOT_START)
"""What every robot publishes so that its run can be replayed through the same code."""
SIM_BUS = Topic("bus", "sim/{fleet}/{robot}/bus", messages.SimulatedBus, 1.0, 3.0)
FAULT = Topic("fault", "sim/{fleet}/{robot}/fault", messages.FaultOrder, recorded=False)

WATCHED: tuple[Topic, ...] = (*ROBOTS_OWN, ESTOP, IN_COMMAND, TRUTH, SIM_BUS)
"""What an operator's page and live viewers hear."""
PUBLISHED: tuple[Topic, ...] = (*WATCHED, *STEP_RECORD)


def liveliness_key(fleet: str, process: str) -> str:
    """Key of the liveliness token of one process, e.g. a robot's name, "sim" or "ground"."""
    return f"echelon/{fleet}/alive/{process}"
