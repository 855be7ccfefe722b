"""Random and mutated payloads for everything that a robot hears by Zenoh."""

import json
from typing import Any

import msgspec
from numpy.random import Generator

from config.messages import (
    Command,
    Estop,
    Ground,
    Motion,
    Sighting,
    Unreadable,
    decode,
    encode,
)

EVIL_NUMBERS = (
    *("0", "-0.0", "-1", "1e400", "-1e400", "1e308", "-1e308", "5e-324", "NaN", "Infinity"),
    *("9223372036854775807", "9223372036854775808", "-9223372036854775809", "1" + 40 * "0"),
    *("3.1415926535", "1e-12", "1e15", "true", "null", '"7"', "[]", "{}"),
)
EVIL_TEXTS = (
    *("", "\x00", "r1", "../../x", "\ud7ff", "R" * 2000, '"', "arm", "start", "stop", "reset"),
    "at_start",
    *("RUNNING", "ESTOP", "\u202e", "%s%n", "{name}"),
)
DEEPEST = 100_000


OBEYED = ("arm", "start", "stop", "reset")


def is_quiet(topic: str, payload: bytes) -> bool:
    """Whether it may not change what the robot does: not readable, nobody's, or no command."""
    try:
        if topic == "motion":
            return decode(payload, Motion).robot not in ("r1", "r2")
        if topic == "command":
            return decode(payload, Command).name not in OBEYED
    except Unreadable:
        return True
    return True


class PayloadFuzzer:
    """Makes payloads. `motion` and so on are honest ones with present times to start from."""

    def __init__(self, rng: Generator, leader: str, marker: int, robot: str) -> None:
        self._rng = rng
        self._leader, self._marker, self._robot = leader, marker, robot

    def honest(self, topic: str, now_s: float, wall_s: float) -> msgspec.Struct:
        """A message of this topic as it should be."""
        head: dict[str, Any] = {
            "seq": 1,
            "t_ns": round(now_s * 1e9),
            "wall_ns": round(wall_s * 1e9),
        }
        if topic == "motion":
            return self._motion(head)
        if topic == "command":
            names = ("arm", "start", "stop", "reset", "go")
            name = names[int(self._rng.integers(len(names)))]
            return Command(name=name, operator="fuzz", override=["bus_load"])
        return (Estop if topic == "estop" else Ground)(**head, operator="fuzz")

    def _motion(self, head: dict[str, Any]) -> Motion:
        rng = self._rng
        sighting = Sighting(
            self._robot, self._marker, float(rng.uniform(-3, 3)), 0.05, head["t_ns"] - 10_000_000
        )
        states = ("STANDBY", "ARMED", "RUNNING", "STOPPING")
        return Motion(
            **head,
            robot=self._leader,
            state=states[int(rng.integers(len(states)))],
            reason="fuzz",
            mission_time_s=None,
            speed_mps=float(rng.uniform(-1, 1)),
            steering_rad=float(rng.uniform(-0.5, 0.5)),
            sightings=[sighting],
        )

    def one(self, topic: str, now_s: float, wall_s: float) -> bytes:
        """One payload."""
        kind = self._rng.integers(7)
        if kind == 0:
            return self._rng.bytes(int(self._rng.integers(300)))
        body = encode(self.honest(topic, now_s, wall_s))
        if kind == 1:
            return self._flipped(body)
        if kind == 2:
            return body[: int(self._rng.integers(len(body)))]
        if kind == 3 and self._rng.random() < 0.02:
            return self._deep(body)
        return self._restructured(body)

    def _flipped(self, body: bytes) -> bytes:
        data = bytearray(body)
        for _ in range(int(self._rng.integers(1, 5))):
            data[int(self._rng.integers(len(data)))] = int(self._rng.integers(256))
        return bytes(data)

    def _deep(self, body: bytes) -> bytes:
        """An unknown field with a value nested beyond all reason."""
        nested = b"[" * DEEPEST + b"]" * DEEPEST
        return b'{"extra":' + nested + b"," + body[1:]

    def _restructured(self, body: bytes) -> bytes:
        """Well-formed JSON with fields removed, renamed, repeated or of another value."""
        fields: dict[str, Any] = json.loads(body)
        texts = {name: json.dumps(value) for name, value in fields.items()}
        for _ in range(int(self._rng.integers(1, 4))):
            name = list(texts)[int(self._rng.integers(len(texts)))]
            action = self._rng.integers(5)
            if action == 0 and len(texts) > 1:
                del texts[name]
            elif name == "sightings" and action < 4:
                texts[name] = self._sightings(fields[name])
            elif action == 1:
                texts[name] = json.dumps(EVIL_TEXTS[int(self._rng.integers(len(EVIL_TEXTS)))])
            else:
                texts[name] = self._number()
        return ("{" + ",".join(f"{json.dumps(k)}:{v}" for k, v in texts.items()) + "}").encode()

    def _sightings(self, honest: list[dict[str, Any]]) -> str:
        one = {name: json.dumps(value) for name, value in honest[0].items()} if honest else {}
        name = ("bearing_rad", "std_rad", "t_ns", "marker")[int(self._rng.integers(4))]
        one[name] = self._number()
        text = "{" + ",".join(f"{json.dumps(k)}:{v}" for k, v in one.items()) + "}"
        return "[" + ",".join([text] * int(self._rng.integers(1, 20))) + "]"

    def _number(self) -> str:
        return EVIL_NUMBERS[int(self._rng.integers(len(EVIL_NUMBERS)))]
