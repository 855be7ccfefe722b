"""Reader of the UTIAS multi-robot cooperative localisation and mapping (MRCLAM) data sets.

One folder holds, for each robot N, `RobotN_Odometry.dat`, `RobotN_Measurement.dat` and
`RobotN_Groundtruth.dat`, and for all of them `Barcodes.dat` and `Landmark_Groundtruth.dat`; each
may be compressed (`.xz`). The range column of the measurements is not read: it is for evaluation
by others, and nothing here may come to depend on it.
"""

import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from sim_hw.dataset.table import DataSetError, Table

__all__ = [
    "BearingRow",
    "DataSetError",
    "Landmark",
    "OdometryRow",
    "PoseRow",
    "Recording",
    "read_recording",
    "robots_in",
]

_ODOMETRY = ("time [s]", "forward velocity [m/s]", "angular velocity [rad/s]")
_MEASUREMENT = ("time [s]", "barcode", "range [m]", "bearing [rad]")
_GROUNDTRUTH = ("time [s]", "x [m]", "y [m]", "orientation [rad]")
_BARCODES = ("subject", "barcode")
_LANDMARKS = ("subject", "x [m]", "y [m]", "x std-dev [m]", "y std-dev [m]")
_ROBOT_FILE = re.compile(r"Robot([1-9][0-9]*)_Odometry\.dat(\.xz)?")
_MAX_SUBJECT = 1022


class Landmark(NamedTuple):
    """A landmark's subject number and place [m]."""

    subject: int
    x_m: float
    y_m: float


class OdometryRow(NamedTuple):
    """Commanded forward and angular velocity from this time on."""

    t_s: float
    speed_mps: float
    rate_radps: float


class BearingRow(NamedTuple):
    """Bearing from the robot's forward axis, anticlockwise, to a subject of the data set."""

    t_s: float
    subject: int
    bearing_rad: float


class PoseRow(NamedTuple):
    """A robot's pose by motion capture."""

    t_s: float
    x_m: float
    y_m: float
    heading_rad: float


class Recording(NamedTuple):
    """All of one robot, in the order of time [s]; `start_s` to `end_s` is what can be judged.

    `unknown_barcodes` counts the measurements that were left out because their barcode belongs
    to no subject, `path` is the folder.
    """

    path: Path
    robot: int
    landmarks: tuple[Landmark, ...]
    odometry: tuple[OdometryRow, ...]
    bearings: tuple[BearingRow, ...]
    truth: tuple[PoseRow, ...]
    unknown_barcodes: dict[int, int]
    start_s: float
    end_s: float

    @property
    def landmark_subjects(self) -> frozenset[int]:
        """Subjects that are landmarks; all others are robots."""
        return frozenset(landmark.subject for landmark in self.landmarks)


def robots_in(folder: Path) -> list[int]:
    """Numbers of the robots of a data set. Raises DataSetError where there are none."""
    if not folder.is_dir():
        what = "not a folder" if folder.exists() else "no such folder"
        raise DataSetError(f"{folder}: {what}; name the folder of a MRCLAM data set")
    found = (_ROBOT_FILE.fullmatch(path.name) for path in folder.iterdir())
    numbers = sorted({int(match[1]) for match in found if match})
    if not numbers:
        raise DataSetError(
            f"{folder}: no RobotN_Odometry.dat in it, plain or .xz; name the folder of a MRCLAM "
            "data set"
        )
    return numbers


def read_recording(folder: Path, robot: int) -> Recording:
    """One robot of the data set in `folder`. Raises DataSetError and nothing else."""
    known = robots_in(folder)
    if robot not in known:
        numbers = ", ".join(map(str, known))
        raise DataSetError(f"{folder}: no robot {robot}; the data set has {numbers}")
    prefix = f"Robot{robot}"
    odometry = _odometry(Table(folder / f"{prefix}_Odometry.dat", _ODOMETRY))
    measurements = Table(folder / f"{prefix}_Measurement.dat", _MEASUREMENT)
    truth = _truth(Table(folder / f"{prefix}_Groundtruth.dat", _GROUNDTRUTH))
    subjects = _subjects(Table(folder / "Barcodes.dat", _BARCODES))
    landmarks = _landmarks(Table(folder / "Landmark_Groundtruth.dat", _LANDMARKS))
    bearings, unknown = _bearings(measurements, subjects)
    start_s, end_s = _overlap(measurements.path.parent, robot, odometry, truth)
    if not any(start_s <= bearing.t_s <= end_s for bearing in bearings):
        raise DataSetError(
            f"{measurements.path}: no measurement between {start_s:.3f} and {end_s:.3f} s, where "
            "odometry and ground truth overlap: the files are not of one recording"
        )
    return Recording(folder, robot, landmarks, odometry, bearings, truth, unknown, start_s, end_s)


def _odometry(table: Table) -> tuple[OdometryRow, ...]:
    rows = tuple(OdometryRow(*values) for values in _timed(table, _ODOMETRY))
    if not rows:
        raise table.empty("odometry")
    return rows


def _truth(table: Table) -> tuple[PoseRow, ...]:
    rows = tuple(PoseRow(*values) for values in _timed(table, _GROUNDTRUTH))
    if not rows:
        raise table.empty("ground truth")
    return rows


def _timed(table: Table, columns: tuple[str, ...]) -> list[tuple[float, ...]]:
    """All rows as numbers; the first column must not run backwards."""
    rows: list[tuple[float, ...]] = []
    clock = _Clock(table)
    for line, words in table.rows():
        row = table.numbers(line, words, columns)
        clock.check(line, row[0])
        rows.append(row)
    return rows


class _Clock:
    """Sees to it that a file's times never run backwards; equal times are fine."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self._last: tuple[int, float] | None = None

    def check(self, line: int, t_s: float) -> None:
        """Take the next time. Raises DataSetError where it lies before the last one."""
        if self._last is not None and t_s < self._last[1]:
            raise self._table.problem(
                line,
                f"time {t_s:.3f} s lies before {self._last[1]:.3f} s of line {self._last[0]}: the "
                "clock runs backwards; put the lines in order or take the wrong ones out",
            )
        self._last = line, t_s


def _subjects(table: Table) -> dict[int, int]:
    """Subject of each barcode."""
    subjects: dict[int, int] = {}
    for line, (subject_word, barcode_word) in table.rows():
        subject = _subject(table, line, subject_word)
        barcode = table.whole(line, barcode_word, "barcode")
        if barcode in subjects:
            raise table.problem(
                line,
                f"barcode {barcode} is that of subject {subjects[barcode]} already: every subject "
                "needs its own",
            )
        subjects[barcode] = subject
    if not subjects:
        raise table.empty("barcodes")
    return subjects


def _landmarks(table: Table) -> tuple[Landmark, ...]:
    landmarks: dict[int, Landmark] = {}
    for line, words in table.rows():
        subject = _subject(table, line, words[0])
        x_m, y_m = (table.number(line, words[i], _LANDMARKS[i]) for i in (1, 2))
        if subject in landmarks:
            raise table.problem(line, f"subject {subject} has a place already: take one line out")
        landmarks[subject] = Landmark(subject, x_m, y_m)
    if not landmarks:
        raise table.empty("landmarks")
    return tuple(landmarks.values())


def _subject(table: Table, line: int, word: str) -> int:
    subject = table.whole(line, word, "subject")
    if subject > _MAX_SUBJECT:
        raise table.problem(line, f"subject is {subject}, at most {_MAX_SUBJECT} fit on the bus")
    return subject


def _bearings(
    table: Table, subjects: dict[int, int]
) -> tuple[tuple[BearingRow, ...], dict[int, int]]:
    """Measurements of known barcodes without their ranges, and how many have which other one."""
    bearings: list[BearingRow] = []
    unknown: Counter[int] = Counter()
    clock = _Clock(table)
    for line, (time_word, barcode_word, _range_word, bearing_word) in table.rows():
        t_s = table.number(line, time_word, _MEASUREMENT[0])
        barcode = table.whole(line, barcode_word, _MEASUREMENT[1])
        bearing_rad = table.number(line, bearing_word, _MEASUREMENT[3])
        clock.check(line, t_s)
        subject = subjects.get(barcode)
        if subject is None:
            unknown[barcode] += 1
        else:
            bearings.append(BearingRow(t_s, subject, bearing_rad))
    if not bearings and not unknown:
        raise table.empty("measurements")
    if not bearings:
        numbers = ", ".join(map(str, sorted(unknown)))
        raise DataSetError(
            f"{table.path}: none of its barcodes ({numbers}) is in Barcodes.dat: the files are "
            "not of one data set, or Barcodes.dat is incomplete"
        )
    return tuple(bearings), dict(sorted(unknown.items()))


def _overlap(
    folder: Path, robot: int, odometry: tuple[OdometryRow, ...], truth: tuple[PoseRow, ...]
) -> tuple[float, float]:
    start_s = max(odometry[0].t_s, truth[0].t_s)
    end_s = min(odometry[-1].t_s, truth[-1].t_s)
    if start_s >= end_s:
        raise DataSetError(
            f"{folder}: odometry of robot {robot} ({odometry[0].t_s:.3f} to {odometry[-1].t_s:.3f} "
            f"s) and its ground truth ({truth[0].t_s:.3f} to {truth[-1].t_s:.3f} s) do not "
            "overlap: the files are not of one recording"
        )
    return start_s, end_s
