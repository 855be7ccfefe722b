"""Zenoh endpoints such as tcp/127.0.0.1:7447, as far as the ground station must understand them."""

import re
import socket

from groundstation.errors import GroundError

_TCP = re.compile(r"tcp/(?P<host>\[[^\]]+\]|[^:/\[\]]+):(?P<port>\d{1,5})")
_LOOPBACK = frozenset({"127.0.0.1", "localhost", "[::1]"})


def host_and_port(endpoint: str) -> tuple[str, int]:
    """Host and port of a TCP endpoint.

    Raises GroundError when the text is no TCP endpoint.
    """
    found = _TCP.fullmatch(endpoint)
    if found is None or int(found["port"]) > 65535:
        raise GroundError(
            f"{endpoint!r} is no TCP endpoint: write tcp/ADDRESS:PORT, e.g. tcp/127.0.0.1:7447"
        )
    return found["host"], int(found["port"])


def with_real_port(endpoint: str) -> str:
    """The endpoint with a port that is free right now where it asks for any port (0).

    Others must know the port before anything listens on it, so it cannot be left to the listener.
    """
    host, port = host_and_port(endpoint)
    if port != 0:
        return endpoint
    family = socket.AF_INET6 if host.startswith("[") else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.bind((host.strip("[]"), 0))
            return f"tcp/{host}:{probe.getsockname()[1]}"
    except OSError as error:
        raise GroundError(
            f"{endpoint} is no address of this machine: {error.strerror or error}"
        ) from error


def on_loopback(endpoint: str) -> str:
    """The endpoint with the same port on the loopback address, for a rehearsal on one machine."""
    host, port = host_and_port(endpoint)
    return endpoint if host in _LOOPBACK else f"tcp/127.0.0.1:{port}"
