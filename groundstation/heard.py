"""A message as the ground station has heard it, from the network or from a recording."""

from typing import NamedTuple

from config.messages import Message


class Heard(NamedTuple):
    """When it arrived [s, wall clock], its key, raw (for recorder and Foxglove) and decoded."""

    time_s: float
    key: str
    payload: bytes
    message: Message
