"""Faults that people inject while the simulation runs: queries on `config.topics.FAULT`.

Polled by the loop; no callback, no thread.
"""

from collections.abc import Iterable

import zenoh
from pydantic import ValidationError
from zenoh.handlers import FifoChannel

from config import topics
from config.faults import Fault
from config.messages import CommandReply, FaultOrder, Unreadable, decode, encode
from sim_hw.fleet import FaultRefused, SimulatedFleet

BACKLOG = 8


class LiveFaults:
    """Answers orders for the robots in `names`; `poll` it often, for people wait."""

    def __init__(
        self,
        session: zenoh.Session,
        fleet_name: str,
        names: Iterable[str],
        simulated: SimulatedFleet,
    ) -> None:
        self._simulated = simulated
        self._keys = {name: topics.FAULT.key(fleet_name, name) for name in names}
        self._queryables = {
            name: session.declare_queryable(key, FifoChannel(BACKLOG))
            for name, key in self._keys.items()
        }

    def poll(self) -> list[str]:
        """Carry out what was ordered; returns sentences on faults begun and ended."""
        for name, queryable in self._queryables.items():
            while (query := queryable.handler.try_recv()) is not None:
                with query:
                    payload = query.payload.to_bytes() if query.payload is not None else b""
                    query.reply(self._keys[name], encode(self._answer(name, payload)))
        return [f"fault: {note}" for note in self._simulated.take_notes()]

    def _answer(self, name: str, payload: bytes) -> CommandReply:
        try:
            order = decode(payload, FaultOrder)
            self._simulated.inject(
                Fault(
                    robot=name,
                    device=order.device,
                    kind=order.kind,
                    for_s=order.for_s,
                    value=order.value,
                )
            )
        except Unreadable as error:
            return _refused(name, f"order cannot be read: {error}")
        except ValidationError as error:
            return _refused(name, "; ".join(each["msg"] for each in error.errors()))
        except FaultRefused as refusal:
            return _refused(name, str(refusal))
        return CommandReply(robot=name, accepted=True, reason="")


def _refused(name: str, reason: str) -> CommandReply:
    return CommandReply(robot=name, accepted=False, reason=reason)
