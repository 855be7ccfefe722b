"""One connected page: the newest of every kind of message, and no more frames than it draws.

What is due goes out as one JSON list of messages: every packet has its price.
"""

import asyncio

from starlette.websockets import WebSocket, WebSocketDisconnect

FRAMES_AHEAD = 8
"""So many frames may be on their way to a page that has not drawn them yet."""
LOG_BACKLOG = 1000


class PageClient:
    """What waits for one page. A slow page gets the newest frame, never a queue of old ones."""

    def __init__(self, number: int, websocket: WebSocket, name: str) -> None:
        self.number, self.name = number, name
        self.authorised = self.wants_truth = False
        self.frames_sent = self.frames_dropped = 0
        self._websocket = websocket
        self._newest: dict[str, bytes] = {}
        self._ordered: list[bytes] = []
        self._frame_number = 0
        self._drawn: int | None = None
        self._wake = asyncio.Event()
        self._closed = False

    def offer(self, kind: str, data: bytes) -> None:
        """Something of which only the newest matters."""
        self._newest[kind] = data
        self._wake.set()

    def offer_frame(self, number: int, data: bytes) -> None:
        """A frame; it replaces one that is still waiting."""
        if "frame" in self._newest:
            self.frames_dropped += 1
        self._frame_number = number
        if self._drawn is None:
            self._drawn = number - 1
        self.offer("frame", data)

    def post(self, data: bytes) -> None:
        """Something that must not be lost; a page that reads nothing for long is let go."""
        self._ordered.append(data)
        self._closed = self._closed or len(self._ordered) > LOG_BACKLOG
        self._wake.set()

    def drawn(self, number: int) -> None:
        """The page has drawn this frame."""
        self._drawn = max(self._drawn or 0, min(number, self._frame_number))
        self._wake.set()

    async def send(self) -> None:
        """Send until the connection ends."""
        sent_number = 0
        try:
            while not self._closed:
                await self._wake.wait()
                self._wake.clear()
                due, self._ordered = self._ordered, []
                if self._drawn is None or sent_number - self._drawn < FRAMES_AHEAD:
                    if "frame" in self._newest:
                        sent_number = self._frame_number
                        self.frames_sent += 1
                    due += self._newest.values()
                    self._newest = {}
                if due:
                    await self._websocket.send_bytes(b"[" + b",".join(due) + b"]")
        except (WebSocketDisconnect, RuntimeError):
            return
