"""What the ground station knows of a fleet right now: the latest message of each robot."""

from typing import TypeVar

from config.messages import Message, Motion, RelativeEstimate, Status
from groundstation.keys import Address

M = TypeVar("M", bound=Message)


class FleetView:
    """The latest messages, and which processes announce that they live."""

    def __init__(self) -> None:
        self.alive: set[str] = set()
        self._latest: dict[tuple[str, type[Message]], Message] = {}

    def hear(self, address: Address, message: Message) -> None:
        """Keep a message unless a newer one of its robot and topic is known already."""
        key = (address.robot, type(message))
        known = self._latest.get(key)
        if known is None or known.wall_ns <= message.wall_ns:
            self._latest[key] = message

    def status(self, robot: str) -> Status | None:
        """Latest status of a robot."""
        return self._newest(robot, Status)

    def motion(self, robot: str) -> Motion | None:
        """Latest motion of a robot."""
        return self._newest(robot, Motion)

    def relative(self, robot: str) -> RelativeEstimate | None:
        """Latest estimate that a follower has of its leader."""
        return self._newest(robot, RelativeEstimate)

    def age_s(self, robot: str, now_wall_ns: int) -> float | None:
        """Time since the capture of the robot's latest status, by the wall clocks of both hosts."""
        status = self.status(robot)
        return None if status is None else (now_wall_ns - status.wall_ns) * 1e-9

    def state(self, robot: str) -> str:
        """The robot's state by its newest status or motion; empty while nothing was heard."""
        return self.state_and_reason(robot)[0]

    def state_and_reason(self, robot: str) -> tuple[str, str]:
        """As `state`, with the robot's own text for it."""
        known = [row for row in (self.status(robot), self.motion(robot)) if row is not None]
        if not known:
            return "", ""
        newest = max(known, key=lambda row: row.wall_ns)
        return newest.state, newest.reason

    def _newest(self, robot: str, kind: type[M]) -> M | None:
        message = self._latest.get((robot, kind))
        return message if isinstance(message, kind) else None
