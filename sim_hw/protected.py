"""Sender of one message with end-to-end protection: its counter and its check sum."""

from typing import Any

from config.can.codec import Codec
from config.can.e2e import data_id_list, protect
from config.can.frame import Frame


class ProtectedSender:
    """Makes the frames of one message, each with the next counter. The message must be protected
    in the CAN database (E2E profile 2)."""

    __slots__ = ("_codec", "_counter", "_id_list")

    def __init__(self, codec: Codec[Any]) -> None:
        if codec.e2e_data_id is None:
            raise ValueError(f"message {codec.name} has no end-to-end protection in the database")
        self._codec = codec
        self._id_list = data_id_list(codec.e2e_data_id)
        self._counter = 0

    def frame(self, t_s: float, row: tuple[float, ...]) -> Frame:
        """The message with the values of `row`, in the order of its signals."""
        data = protect(self._codec.pack(*row), self._id_list, self._counter)
        self._counter = (self._counter + 1) & 0x0F
        return Frame(self._codec.can_id, data, t_s)
