"""Orders and emergency stops from pages to the fleet; who is in command."""

import asyncio
import time
from collections.abc import Callable
from typing import get_args

from config.fleet import Fleet
from config.messages import InCommand
from groundstation.fleet_commands import CommandName
from groundstation.web import wire
from groundstation.web.authority import Authority, Holder
from groundstation.web.estop_latch import EstopLatch
from groundstation.web.interface import CommandPort, Order
from groundstation.web.page_client import PageClient

ESTOP_PERIOD_S = 0.05
ANNOUNCE_PERIOD_S = 1.0
RESET_AFTER_ESTOP_S = 0.7
"""Robots refuse a reset for 0.5 s after the last emergency stop."""
FREE_FOR_ALL = frozenset({"stop"})
"""Orders for which nobody needs to be in command."""
KNOWN: tuple[str, ...] = get_args(CommandName)


class Commanding:
    """The command path of all pages of one server."""

    def __init__(
        self,
        fleet: Fleet,
        port: CommandPort,
        state: Callable[[str], str],
        note: Callable[[str, str], None],
        changed: Callable[[], None],
    ) -> None:
        self._port, self._state, self._note, self._changed = port, state, note, changed
        self._authority = Authority()
        self._latch = EstopLatch(fleet.robots)
        self._repeating: asyncio.Task[None] | None = None
        self._busy = False
        self._announce_s = 0.0
        self._announced = ""

    def estop(self, client: PageClient) -> None:
        """Emergency stop by anybody who sees the page; sent at once and then repeated."""
        self._port.publish_estop(client.name)
        if not self._latch.active:
            self._note("error", f"emergency stop by {client.name}")
        self._latch.press(client.name, time.time())
        if self._repeating is None or self._repeating.done():
            self._repeating = asyncio.create_task(self._repeat())
        self._changed()

    async def _repeat(self) -> None:
        while self._latch.repeating:
            self._port.publish_estop(self._latch.by)
            await asyncio.sleep(ESTOP_PERIOD_S)

    def withdraw(self, client: PageClient) -> None:
        """Stop repeating the emergency stop to robots that do not answer."""
        if self._latch.active:
            missing = ", ".join(self._latch.missing)
            told = f"; not confirmed by {missing}" if missing else ""
            self._note("warning", f"emergency stop withdrawn by {client.name}{told}")
        self._latch.withdraw()
        self._changed()

    def look(self) -> None:
        """Follow the robots' states and tell other ground stations, once per frame."""
        before = self._latch.active, len(self._latch.missing)
        self._latch.look(self._state)
        if before != (self._latch.active, len(self._latch.missing)):
            self._changed()
        holder = self._authority.holder(time.time())
        own = holder.name if holder is not None and holder.page is not None else ""
        if own != self._announced or (own and time.monotonic() >= self._announce_s):
            self._announce_s, self._announced = time.monotonic() + ANNOUNCE_PERIOD_S, own
            since_s = 0.0 if holder is None else holder.since_s
            self._port.announce_command(own, round(since_s * 1e9))

    def heard_elsewhere(self, message: InCommand, now_s: float) -> None:
        """A ground station says who is in command there; this one's own words are left out."""
        since_s = message.since_ns * 1e-9
        holder = self._authority.holder(now_s)
        own = holder is not None and holder.page is not None and holder.name == message.operator
        if not own and message.operator != self._announced:
            self._authority.heard(message.operator, since_s, now_s)

    def take(self, client: PageClient) -> None:
        """This page's operator takes command."""
        self._authority.take(client.number, client.name, time.time())
        self._note("info", f"{client.name} takes command")
        self._changed()

    def give_back(self, client: PageClient) -> None:
        """This page's operator gives command back."""
        self._authority.give_back(client.number)
        self._changed()

    def gone(self, client: PageClient) -> None:
        """A page has lost its connection."""
        self._authority.gone(client.number, time.time())

    def back(self, client: PageClient) -> None:
        """A page has come, perhaps again: the same operator keeps the command."""
        self._authority.back(client.number, client.name)

    async def give(self, client: PageClient, order: wire.Give) -> wire.Answer:
        """Send an order to all robots and say what they answered."""
        refusal = self._refusal(client, order)
        if refusal is not None:
            return wire.Answer(order.id, False, refusal, {})
        self._busy = True
        try:
            if order.name == "reset" and self._latch.active:
                self.withdraw(client)
                await asyncio.sleep(RESET_AFTER_ESTOP_S)
            wanted = Order(order.name, client.name, order.formation)
            replies = await asyncio.to_thread(self._port.send, wanted)
        finally:
            self._busy = False
        refused = {name: reply.reason for name, reply in replies.items() if not reply.accepted}
        what = " ".join((order.name, order.formation)).strip()
        text = f"{what} by {client.name}: " + _told(refused, len(replies))
        self._note("warning" if refused else "info", text)
        return wire.Answer(order.id, not refused, _told(refused, len(replies)), refused)

    def _refusal(self, client: PageClient, order: wire.Give) -> str | None:
        if not client.authorised:
            return "this page has no token: open the address that the ground station has printed"
        if order.name not in KNOWN:
            return f"no command {order.name!r}; known are {', '.join(KNOWN)}"
        if self._busy and order.name not in FREE_FOR_ALL:
            return "another command is still being answered"
        if order.name in FREE_FOR_ALL:
            return None
        return self._authority.may_command(client.number, client.name, time.time())

    def commander(self, client: PageClient) -> wire.Commander | None:
        """Who is in command, as this page sees it."""
        holder: Holder | None = self._authority.holder(time.time())
        if holder is None:
            return None
        you = holder.page == client.number
        return wire.Commander(holder.name, holder.since_s, you, holder.page is None)

    def estop_shown(self) -> wire.EstopShown | None:
        """The emergency stop given here, while it is latched."""
        latch = self._latch
        if not latch.active:
            return None
        return wire.EstopShown(
            latch.by, latch.since_s, latch.confirmed, latch.missing, latch.repeating
        )


def _told(refused: dict[str, str], asked: int) -> str:
    if not refused:
        return f"accepted by all {asked} robots"
    return "; ".join(f"{name} refuses: {reason}" for name, reason in refused.items())
