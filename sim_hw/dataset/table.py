"""Text tables of a data set: whitespace columns, `#` comments, plain or compressed with xz."""

import lzma
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

_SHOWN_CHARACTERS = 40


class DataSetError(Exception):
    """A data set cannot be used; the text names file, line and value, and says what to do."""


class Table:
    """One file of a data set; every problem in it names the file, and the line where there is one.

    `path` is the name without `.xz`; of the two, the plain file wins.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        """Raises DataSetError where there is no such file."""
        packed = path.with_name(path.name + ".xz")
        if path.exists():
            self.path = path
        elif packed.exists():
            self.path = packed
        else:
            raise DataSetError(
                f"{path}: no such file, nor {packed.name}; a MRCLAM data set holds it: fetch the "
                "whole set again, or name another folder or robot"
            )
        self._columns = columns

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Line number, counted from 1, and the columns of every line that holds data.

        Raises DataSetError for a file that cannot be read and for a line of another length.
        """
        for number, line in enumerate(self._text().splitlines(), 1):
            words = line.split()
            if not words or words[0].startswith("#"):
                continue
            if len(words) != len(self._columns):
                raise self.problem(
                    number,
                    f"{len(words)} columns where {len(self._columns)} are due "
                    f"({', '.join(self._columns)}): {_shortened(line)!r}; the line is cut off or "
                    "the file damaged: fetch it again or take the line out",
                )
            yield number, words

    def number(self, line: int, word: str, column: str) -> float:
        """A finite number. Raises DataSetError."""
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.problem(
                line,
                f"{column} is {_shortened(word)!r}, not a finite number: correct the line or take "
                "it out",
            )
        return value

    def numbers(self, line: int, words: list[str], columns: Sequence[str]) -> tuple[float, ...]:
        """A whole row of finite numbers, of which there are many. Raises DataSetError."""
        try:
            row = tuple(map(float, words))
        except ValueError:
            row = (math.nan,)
        if math.isfinite(sum(row)):
            return row
        return tuple(
            self.number(line, word, column) for word, column in zip(words, columns, strict=True)
        )

    def whole(self, line: int, word: str, column: str) -> int:
        """A whole number that is not negative. Raises DataSetError."""
        value = self.number(line, word, column)
        if value < 0 or value != int(value):
            raise self.problem(
                line,
                f"{column} is {_shortened(word)!r}, not a whole number from 0 on: correct the line",
            )
        return int(value)

    def problem(self, line: int, text: str) -> DataSetError:
        """An error in one line."""
        return DataSetError(f"{self.path}:{line}: {text}")

    def empty(self, what: str) -> DataSetError:
        """The error of a file without any data."""
        return DataSetError(
            f"{self.path}: holds no {what}: the recording is empty or cut off; fetch the file "
            "again or choose another robot"
        )

    def _text(self) -> str:
        try:
            data = self.path.read_bytes()
            if self.path.suffix == ".xz":
                data = lzma.decompress(data)
            return data.decode("utf-8")
        except (lzma.LZMAError, EOFError) as error:
            raise DataSetError(
                f"{self.path}: not a whole xz file ({error}): fetch it again"
            ) from error
        except UnicodeDecodeError as error:
            raise DataSetError(
                f"{self.path}: not text (byte {error.start}): fetch it again"
            ) from error
        except OSError as error:
            raise DataSetError(f"{self.path}: cannot be read: {error.strerror}") from error


def _shortened(text: str) -> str:
    text = text.strip()
    return text if len(text) <= _SHOWN_CHARACTERS else f"{text[:_SHOWN_CHARACTERS]}..."
