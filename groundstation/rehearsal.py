"""A fleet turned into its own rehearsal: emulated buses and loopback endpoints on one machine."""

from pathlib import Path
from typing import NamedTuple

from config.fleet import Fleet
from groundstation.endpoints import on_loopback, with_real_port
from groundstation.errors import GroundError
from groundstation.fleet_link import ANY_LOOPBACK

SOCKET_PATH_LIMIT = 107
EMULATED = frozenset({"simcan", "virtual"})


class Rehearsal(NamedTuple):
    """The effective fleet, and what was replaced in it, in words."""

    fleet: Fleet
    notes: list[str]


def rehearsal(fleet: Fleet, runtime: Path) -> Rehearsal:
    """The fleet with its CAN buses emulated in the folder `runtime`, all on the loopback address.

    Raises GroundError when a socket's path would be too long or an endpoint is none.
    """
    can = {
        name: {"interface": "simcan", "channel": f"{runtime}/{name}.sock"} for name in fleet.robots
    }
    for each in can.values():
        if len(each["channel"].encode()) > SOCKET_PATH_LIMIT:
            raise GroundError(
                f"socket path {each['channel']} has {len(each['channel'].encode())} bytes, limit "
                f"{SOCKET_PATH_LIMIT}: set TMPDIR to a shorter folder"
            )
    robots = {
        name: robot.model_copy(
            update={
                "can": robot.can.model_copy(update=can[name]),
                "listen": _own_listen(robot.listen),
            }
        )
        for name, robot in fleet.robots.items()
    }
    ground = with_real_port(on_loopback(fleet.ground))
    return Rehearsal(
        fleet.model_copy(update={"robots": robots, "ground": ground}), _notes(fleet, ground)
    )


def _own_listen(endpoint: str) -> str:
    return endpoint if on_loopback(endpoint) == endpoint else ANY_LOOPBACK


def _notes(fleet: Fleet, ground: str) -> list[str]:
    buses = sorted(
        {
            f"{robot.can.interface} {robot.can.channel}"
            for robot in fleet.robots.values()
            if robot.can.interface not in EMULATED
        }
    )
    notes = []
    if buses:
        notes.append(
            f"rehearsal, no robot moves: simulated hardware on simcan replaces {', '.join(buses)}"
        )
    if ground != fleet.ground:
        notes.append(f"rehearsal on this machine: ground endpoint is {ground}, not {fleet.ground}")
    return notes
