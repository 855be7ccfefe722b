"""`echelon monitor`: the page of a live fleet, as its ground station or beside one."""

import gc
import os
from collections.abc import Callable

from config import topics
from config.fleet import Fleet
from groundstation.endpoints import with_real_port
from groundstation.errors import GroundError
from groundstation.fleet_link import FleetLink
from groundstation.web.live import LinkCommands, LinkSource
from groundstation.web.server import Listen, PageServer

HEARD = [topic for topic in topics.WATCHED if topic is not topics.TRUTH]
ONE_RECEIVER = "(rx: (worker_threads: 1))"
"""One receiving thread instead of two: a tenth less processor time with ten robots."""


def monitor(fleet: Fleet, listen: Listen, say: Callable[[str], None]) -> None:
    """Serve the page until the process is interrupted.

    Where nobody listens on the fleet's ground endpoint, this is the ground station; where somebody
    does, it joins as a visitor. Raises GroundError when the page's port is in use.
    """
    os.environ.setdefault("ZENOH_RUNTIME", ONE_RECEIVER)
    link, role = _link(fleet)
    with link:
        server = PageServer(fleet, LinkSource(link), LinkCommands(fleet, link), listen=listen)
        say(f"fleet {fleet.name}, {role}")
        say(f"page: {server.url}")
        gc.collect()
        gc.freeze()
        server.run()


def _link(fleet: Fleet) -> tuple[FleetLink, str]:
    fleet = fleet.model_copy(update={"ground": with_real_port(fleet.ground)})
    try:
        link = FleetLink.as_ground_station(fleet, HEARD, newest=True)
        return link, f"ground station on {fleet.ground}"
    except GroundError as refusal:
        if "in use" not in str(refusal):
            raise
        visitor = FleetLink.as_visitor(fleet, HEARD, newest=True)
        return visitor, f"beside the ground station on {fleet.ground}"
