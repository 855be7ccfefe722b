"""Who commands: one operator at a time, whom everybody else sees. Pure: time is passed in."""

from typing import NamedTuple

GRACE_S = 10.0
"""A page that has lost its connection keeps its command for so long."""
ELSEWHERE_S = 3.0
"""So long after its last word another ground station's command is over."""


class Holder(NamedTuple):
    """The operator in command: page number (None: at another ground station), name, since when."""

    page: int | None
    name: str
    since_s: float


class Authority:
    """The latest to have taken command has it, here or at another ground station."""

    def __init__(self) -> None:
        self._holder: Holder | None = None
        self._gone_s: float | None = None
        self._heard_s = 0.0

    def holder(self, now_s: float) -> Holder | None:
        """Who is in command now."""
        over_here = self._gone_s is not None and now_s - self._gone_s > GRACE_S
        remote = self._holder is not None and self._holder.page is None
        if over_here or (remote and now_s - self._heard_s > ELSEWHERE_S):
            self._holder, self._gone_s = None, None
        return self._holder

    def take(self, page: int, name: str, now_s: float) -> Holder:
        """A page's operator takes command from whoever has it."""
        self._holder, self._gone_s = Holder(page, name, now_s), None
        return self._holder

    def may_command(self, page: int, name: str, now_s: float) -> str | None:
        """Let a page command: it takes command where nobody has it. Returns why it may not."""
        holder = self.holder(now_s)
        if holder is None:
            self.take(page, name, now_s)
        elif holder.page != page:
            return f"{holder.name} is in command: take command first"
        return None

    def give_back(self, page: int) -> None:
        """A page's operator gives command back."""
        if self._holder is not None and self._holder.page == page:
            self._holder, self._gone_s = None, None

    def gone(self, page: int, now_s: float) -> None:
        """A page has lost its connection."""
        if self._holder is not None and self._holder.page == page:
            self._gone_s = now_s

    def back(self, page: int, name: str) -> int | None:
        """The page that a returning operator of this name has had, where it had command."""
        holder = self._holder
        if holder is None or holder.page is None or self._gone_s is None or holder.name != name:
            return None
        self._holder, self._gone_s = holder._replace(page=page), None
        return page

    def heard(self, name: str, since_s: float, now_s: float) -> None:
        """Another ground station says who is in command there, since when by its clock."""
        holder = self._holder
        if not name:
            if holder is not None and holder.page is None:
                self._holder = None
            return
        if holder is None or holder.page is None or since_s > holder.since_s:
            self._holder, self._gone_s, self._heard_s = Holder(None, name, since_s), None, now_s
