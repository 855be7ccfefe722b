"""A Zenoh session that exists only in this process: `Link` on top of it is the real one."""

from collections import deque
from collections.abc import Callable
from typing import Any, Self

import zenoh

from config.closing import Closing


class FakeSample:
    """A sample on a key."""

    def __init__(self, key: str, payload: bytes) -> None:
        self.key_expr, self.payload = key, zenoh.ZBytes(payload)


class FakeQuery(Closing):
    """A query; keeps its replies."""

    def __init__(self, payload: bytes) -> None:
        self.payload = zenoh.ZBytes(payload)
        self.replies: list[bytes] = []
        self.dropped = False

    def close(self) -> None:
        """The query is over."""
        self.dropped = True

    def reply(self, _key: str, payload: bytes) -> None:
        """Keep a reply."""
        self.replies.append(payload)


class FakeHandler:
    """What a channel hands out; it holds `depth` items and forgets the oldest."""

    def __init__(self, depth: int) -> None:
        self.items: deque[Any] = deque(maxlen=depth)

    def try_recv(self) -> Any:
        """The oldest item, or None."""
        return self.items.popleft() if self.items else None


class FakeEntity:
    """Subscriber, queryable, publisher or token."""

    def __init__(self, depth: int = 1, heard: Callable[[bytes], None] | None = None) -> None:
        self.handler = FakeHandler(depth)
        self._heard = heard

    def put(self, payload: bytes) -> None:
        """Publish."""
        if self._heard is not None:
            self._heard(payload)


class FakeSession:
    """Everything that `Link` asks of a session."""

    def __init__(self, depth: int) -> None:
        self.subscribers: dict[str, FakeEntity] = {}
        self.queryables: dict[str, FakeEntity] = {}
        self.published = 0
        self._depth = depth

    def declare_subscriber(self, key: str, _channel: object) -> FakeEntity:
        """A subscriber on a key."""
        return self.subscribers.setdefault(key, FakeEntity(self._depth))

    def declare_queryable(self, key: str, _channel: object) -> FakeEntity:
        """A queryable on a key."""
        return self.queryables.setdefault(key, FakeEntity(self._depth))

    def declare_publisher(self, _key: str) -> FakeEntity:
        """A publisher; what it puts is counted."""
        return FakeEntity(heard=self._count)

    def liveliness(self) -> Self:
        """Tokens are declared on it."""
        return self

    def declare_token(self, _key: str) -> FakeEntity:
        """A liveliness token."""
        return FakeEntity()

    def close(self) -> None:
        """End it."""

    def _count(self, _payload: bytes) -> None:
        self.published += 1
