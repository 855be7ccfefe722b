"""What the ground station knows of a fleet right now: the latest message of each robot."""

from config.messages import Message, Motion, RelativeEstimate, Status
from groundstation.keys import Address
from groundstation.known import Known


class FleetView:
    """The latest messages, and which processes announce that they live."""

    def __init__(self) -> None:
        self.alive: set[str] = set()
        self._known: dict[str, Known] = {}

    def hear(self, address: Address, message: Message) -> None:
        """Keep a message unless a newer one of its robot and topic is known already."""
        self._known.setdefault(address.robot, Known()).hear(message)

    def status(self, robot: str) -> Status | None:
        """Latest status of a robot."""
        return self._of(robot).status

    def motion(self, robot: str) -> Motion | None:
        """Latest motion of a robot."""
        return self._of(robot).motion

    def relative(self, robot: str) -> RelativeEstimate | None:
        """Latest estimate that a follower has of its leader."""
        return self._of(robot).relative

    def age_s(self, robot: str, now_wall_ns: int) -> float | None:
        """Time since the capture of the robot's latest status, by the wall clocks of both hosts."""
        status = self.status(robot)
        return None if status is None else (now_wall_ns - status.wall_ns) * 1e-9

    def state(self, robot: str) -> str:
        """The robot's state by its newest status or motion; empty while nothing was heard."""
        return self.state_and_reason(robot)[0]

    def state_and_reason(self, robot: str) -> tuple[str, str]:
        """As `state`, with the robot's own text for it."""
        newest = self._of(robot).newest
        return ("", "") if newest is None else (newest.state, newest.reason)

    def _of(self, robot: str) -> Known:
        return self._known.get(robot) or Known()
