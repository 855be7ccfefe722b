"""What is opened for a block and closed at its end, whatever happens in it."""

from types import TracebackType
from typing import Self


class Closing:
    """A context manager of itself: leaving the block closes it."""

    def close(self) -> None:
        """Give back what is held; a derived class says what."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
