"""Who leads whom in a fleet."""

from config.fleet import Fleet


def leader_of(fleet: Fleet) -> str:
    """The robot at the head of the formation, which drives the schedule."""
    return next(name for name, robot in fleet.robots.items() if robot.leader is None)


def followers(fleet: Fleet) -> list[str]:
    """Every robot that follows another one."""
    return [name for name, robot in fleet.robots.items() if robot.leader is not None]


def start_order(fleet: Fleet) -> list[str]:
    """Followers first, the leader last: nobody moves before those behind are ready."""
    behind = followers(fleet)
    return behind + [name for name in fleet.robots if name not in behind]
