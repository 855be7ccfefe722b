"""How every process of the fleet opens its Zenoh session.

Peers with explicit endpoints: gossip makes the direct links, nothing is multicast, and a robot
keeps its links to its neighbours when the ground station dies. The lease is what the node that
fails has announced, so every node announces the same short one. Shared memory is off: the first
message over 3 kB would make a pool of 16 MB in every process.
"""

import json

LEASE_MS = 1000
RETRY_FIRST_MS = 100
RETRY_LAST_MS = 1000


def session_config(listen: str, connect: list[str]) -> str:
    """Zenoh configuration (JSON5) of a peer that listens on one endpoint and connects to others.

    Connections are made in the background: a peer that is not there yet is tried again.
    """
    return json.dumps(
        {
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
