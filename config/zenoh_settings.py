"""How every process of the fleet opens its Zenoh session.

Peers with explicit endpoints: gossip makes the direct links, nothing is multicast, and a robot
keeps its links to its neighbours when the ground station dies. The lease is what the node that
fails has announced, so every node announces the same short one. Shared memory is off: the first
message over 3 kB would make a pool of 16 MB in every process.
"""

import json
from collections.abc import Mapping

LEASE_MS = 1000
RETRY_FIRST_MS = 100
RETRY_LAST_MS = 1000


def session_config(
    listen: str, connect: list[str], at_most_hz: Mapping[str, float] | None = None
) -> str:
    """Zenoh configuration (JSON5) of a peer that listens on one endpoint and connects to others.

    Connections are made in the background: a peer that is not there yet is tried again. Of the keys
    in `at_most_hz` [Hz] this peer takes in no more than so many messages.
    """
    rules = [{"key_expr": key, "freq": rate} for key, rate in (at_most_hz or {}).items()]
    taken_in = {"id": "taken-in", "messages": ["put"], "flows": ["ingress"], "rules": rules}
    return json.dumps(
        {
            "downsampling": [taken_in] if rules else [],
            "mode": "peer",
            "listen": {"endpoints": [listen]},
            "connect": {
                "endpoints": connect,
                "timeout_ms": -1,
                "exit_on_failure": False,
                "retry": {
                    "period_init_ms": RETRY_FIRST_MS,
                    "period_max_ms": RETRY_LAST_MS,
                    "period_increase_factor": 2,
                },
            },
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": True}, "delay": 0},
            "transport": {
                "link": {"tx": {"lease": LEASE_MS}},
                "shared_memory": {"enabled": False},
            },
        }
    )
