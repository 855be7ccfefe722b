"""Reading a data set: every broken input gives one message with file, line, value and advice."""

import lzma
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_hw.dataset.mrclam import DataSetError, read_recording, robots_in

ODOMETRY = "Robot1_Odometry.dat"
MEASUREMENT = "Robot1_Measurement.dat"
GROUNDTRUTH = "Robot1_Groundtruth.dat"


def replace_line(path: Path, number: int, text: str) -> None:
    """Line numbers count from 1, the comment at the top included."""
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[number - 1] = text
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def shifted(path: Path, seconds: float) -> None:
    """Move all times of a file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [line.split() for line in lines if not line.startswith("#")]
    path.write_text(
        "".join(f"{float(row[0]) + seconds:.3f} {' '.join(row[1:])}\n" for row in rows),
        encoding="utf-8",
    )


def test_a_whole_set_is_read(data_set: Path) -> None:
    recording = read_recording(data_set, 1)
    assert len(recording.landmarks) == 8
    assert len(recording.odometry) == 2000
    assert recording.end_s - recording.start_s == pytest.approx(39.98)
    assert recording.unknown_barcodes == {}
    assert {seen.subject for seen in recording.bearings} <= recording.landmark_subjects
    assert robots_in(data_set) == [1]


def test_compressed_files_read_alike(data_set: Path) -> None:
    plain = read_recording(data_set, 1)
    for path in list(data_set.iterdir()):
        path.with_name(path.name + ".xz").write_bytes(lzma.compress(path.read_bytes()))
        path.unlink()
    assert read_recording(data_set, 1) == plain


def test_the_range_is_not_handed_on(data_set: Path) -> None:
    replaced = (data_set / MEASUREMENT).read_text(encoding="utf-8").replace("\t1.000\t", "\tnan\t")
    before = read_recording(data_set, 1)
    (data_set / MEASUREMENT).write_text(replaced, encoding="utf-8")
    assert read_recording(data_set, 1) == before


def test_an_unknown_barcode_is_named_and_its_measurements_are_left_out(data_set: Path) -> None:
    before = len(read_recording(data_set, 1).bearings)
    lines = (data_set / MEASUREMENT).read_text(encoding="utf-8").splitlines()
    for number in (4, 9):
        time, _, range_m, bearing = lines[number - 1].split()
        replace_line(data_set / MEASUREMENT, number, f"{time} 999 {range_m} {bearing}")
    recording = read_recording(data_set, 1)
    assert recording.unknown_barcodes == {999: 2}
    assert len(recording.bearings) == before - 2


def _missing_folder(folder: Path) -> None:
    for path in list(folder.iterdir()):
        path.unlink()
    folder.rmdir()


def _missing_file(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def _line(name: str, number: int, text: str) -> Callable[[Path], None]:
    return lambda folder: replace_line(folder / name, number, text)


def _text(name: str, text: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        (folder / name).write_text(text, encoding="utf-8")

    return write


def _bytes(name: str, data: bytes) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        (folder / name.replace(".dat", ".dat.xz")).write_bytes(data)

    return write


def _all_barcodes_unknown(folder: Path) -> None:
    (folder / "Barcodes.dat").write_text("1 5\n", encoding="utf-8")


BROKEN: dict[str, tuple[Callable[[Path], None], list[str]]] = {
    "no folder": (_missing_folder, ["no such folder", "name the folder"]),
    "missing file": (_missing_file(MEASUREMENT), [MEASUREMENT, "no such file", "fetch"]),
    "missing barcodes": (_missing_file("Barcodes.dat"), ["Barcodes.dat", "no such file"]),
    "truncated line": (
        _line(ODOMETRY, 17, "1248000000.30 0.08"),
        [f"{ODOMETRY}:17:", "2 columns where 3 are due", "'1248000000.30 0.08'", "fetch it again"],
    ),
    "not a number": (
        _line(MEASUREMENT, 5, "1248000000.300 61 1.0 l.2"),
        [f"{MEASUREMENT}:5:", "bearing [rad] is 'l.2'", "correct the line"],
    ),
    "NaN": (
        _line(GROUNDTRUTH, 8, "1248000000.120 nan 0 0"),
        [f"{GROUNDTRUTH}:8:", "x [m] is 'nan'"],
    ),
    "infinite": (_line(ODOMETRY, 3, "1248000000.02 inf 0"), [f"{ODOMETRY}:3:", "'inf'"]),
    "clock running backwards": (
        _line(ODOMETRY, 40, "1247999999.000 0.08 0.0"),
        [f"{ODOMETRY}:40:", "1247999999.000 s lies before 1248000000.740 s of line 39", "backward"],
    ),
    "measurement clock running backwards": (
        _line(MEASUREMENT, 30, "1247999999.000 61 1.0 0.0"),
        [f"{MEASUREMENT}:30:", "clock runs backwards"],
    ),
    "barcode with a fraction": (
        _line(MEASUREMENT, 5, "1248000000.300 61.5 1.0 0.2"),
        [f"{MEASUREMENT}:5:", "barcode is '61.5'"],
    ),
    "no known barcode": (_all_barcodes_unknown, [MEASUREMENT, "none of its barcodes", "Barcodes"]),
    "barcode given twice": (
        _line("Barcodes.dat", 3, "2 5"),
        ["Barcodes.dat:3:", "barcode 5 is that of subject 1 already"],
    ),
    "landmark given twice": (
        _line("Landmark_Groundtruth.dat", 3, "6 1 1 0 0"),
        ["Landmark_Groundtruth.dat:3:", "subject 6 has a place already"],
    ),
    "empty measurement file": (_text(MEASUREMENT, ""), [MEASUREMENT, "holds no measurements"]),
    "comments only": (_text(ODOMETRY, "# nothing\n"), [ODOMETRY, "holds no odometry"]),
    "no overlap with ground truth": (
        lambda folder: shifted(folder / GROUNDTRUTH, 1000.0),
        ["odometry of robot 1", "do not overlap", "1248001000.000"],
    ),
    "no measurement in the overlap": (
        lambda folder: shifted(folder / MEASUREMENT, 1000.0),
        [MEASUREMENT, "no measurement between 1248000000.000"],
    ),
    "damaged archive": (_bytes(ODOMETRY, b"no archive"), [f"{ODOMETRY}.xz", "not a whole xz file"]),
    "cut archive": (
        _bytes(ODOMETRY, lzma.compress(b"1 2 3\n" * 1000)[:40]),
        [f"{ODOMETRY}.xz", "not a whole xz file"],
    ),
    "not text": (_bytes(ODOMETRY, lzma.compress(b"\xff\xfe\x00")), [f"{ODOMETRY}.xz", "not text"]),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_input_is_told_in_one_message(case: str, data_set: Path) -> None:
    damage, words = BROKEN[case]
    damage(data_set)
    with pytest.raises(DataSetError) as caught:
        read_recording(data_set, 1)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_an_unknown_robot_is_told_which_there_are(data_set: Path) -> None:
    with pytest.raises(DataSetError, match="no robot 9; the data set has 1"):
        read_recording(data_set, 9)
