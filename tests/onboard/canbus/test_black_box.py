"""The black box: every frame in BLF files that rotate, and that outlive a killed process."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import can
import pytest

from config.can.frame import Frame
from onboard.canbus import black_box
from onboard.canbus.black_box import BlackBox, Logged
from onboard.canbus.port import CanPort

WALL_S = 1.7e9
KILLED = """
import sys, time
from pathlib import Path
from onboard.canbus.black_box import BlackBox, Logged
box = BlackBox(Path(sys.argv[1]), "r1", 100.0, 2)
number = 0
while True:
    number += 1
    box.put([Logged(1e9 + number * 1e-3, 0x100, number.to_bytes(4, "little"), False)] )
    time.sleep(0.0005)
    if number == 200:
        print("going", flush=True)
"""


def frames(numbers: range) -> list[Logged]:
    return [Logged(1e9 + n * 1e-3, 0x100, n.to_bytes(4, "little")) for n in numbers]


def read(path: Path) -> list[can.Message]:
    with can.BLFReader(path) as reader:
        return list(reader)


def numbers(path: Path) -> list[int]:
    return [int.from_bytes(message.data, "little") for message in read(path)]


def test_a_port_logs_what_it_hears_and_sends(tmp_path: Path) -> None:
    box = BlackBox(tmp_path / "deep" / "folder", "r2", 10.0, 2)
    port = CanPort.open("virtual", "test-black-box", 500_000, box)
    with can.Bus("test-black-box", "virtual", ignore_config=True, preserve_timestamps=True) as peer:
        peer.send(can.Message(timestamp=WALL_S + 0.5, arbitration_id=0x41, is_extended_id=False))
        port.receive(1.0, WALL_S + 1.0)
        port.send([Frame(0x4D, b"\x01\x02", 1.0), Frame(0x57, b"", 1.0, remote=True)])
        port.close()
    box.close()
    (path,) = (tmp_path / "deep" / "folder").glob("r2-*.blf")
    heard, sent, asked = read(path)
    assert (heard.arbitration_id, heard.is_rx) == (0x41, True)
    assert (sent.arbitration_id, bytes(sent.data), sent.is_rx) == (0x4D, b"\x01\x02", False)
    assert sent.timestamp == pytest.approx(WALL_S + 1.0, abs=1e-3)
    assert (asked.arbitration_id, asked.is_remote_frame) == (0x57, True)
    assert port.health().log_dropped == 0


def test_files_rotate_are_readable_and_the_oldest_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(black_box, "FLUSH_S", 0.0)
    monkeypatch.setattr(black_box, "CONTAINER_BYTES", 512)
    (tmp_path / "r10-19990101-000000-0001.blf").write_bytes(b"another robot's")
    box = BlackBox(tmp_path, "r1", 0.001, 3)
    for start in range(0, 2000, 10):
        box.put(frames(range(start, start + 10)))
    box.close(10.0)
    assert box.problem is None
    paths = sorted(tmp_path.glob("r1-*.blf"))
    assert 2 <= len(paths) <= 3
    assert int(paths[-1].stem.rpartition("-")[2]) > 3
    kept = [number for path in paths for number in numbers(path)]
    assert kept == list(range(kept[0], 2000))
    assert (tmp_path / "r10-19990101-000000-0001.blf").exists()


def test_a_writer_that_hangs_never_blocks_and_the_loss_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(BlackBox, "_run", lambda _self: None)
    box = BlackBox(tmp_path, "r1", 10.0, 2)
    started_s = time.monotonic()
    for _ in range(black_box.QUEUE_BATCHES + 7):
        box.put(frames(range(3)))
    assert time.monotonic() - started_s < 2.0
    assert box.dropped == 21
    box._writer.stop()


def test_a_full_queue_never_makes_the_loop_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of ten batches for which there is no room, the quickest is handed over at once."""
    monkeypatch.setattr(BlackBox, "_run", lambda _self: None)
    box = BlackBox(tmp_path, "r1", 10.0, 2)
    for _ in range(black_box.QUEUE_BATCHES):
        box.put(frames(range(1)))
    waits_s = []
    for _ in range(10):
        began_s = time.monotonic()
        box.put(frames(range(1)))
        waits_s.append(time.monotonic() - began_s)
    assert box.dropped == 10
    assert min(waits_s) < 0.002
    box._writer.stop()


def test_a_disk_that_fails_is_told_and_does_not_stop_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_frame: Logged) -> can.Message:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(black_box, "_message", full)
    box = BlackBox(tmp_path, "r1", 10.0, 2)
    box.put(frames(range(3)))
    deadline = time.monotonic() + 5.0
    while box.problem is None and time.monotonic() < deadline:
        time.sleep(0.005)
    assert "No space left on device" in str(box.problem)
    box.put(frames(range(4)))
    assert box.dropped == 4
    box.close()
    box._writer.stop()


@pytest.mark.process
def test_what_a_killed_process_logged_is_readable_up_to_the_last_second(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == "going\n"
        deadline = time.monotonic() + 20.0
        (path,) = tmp_path.glob("*.blf")
        while path.stat().st_size < 5000 and time.monotonic() < deadline:
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
    kept = numbers(path)
    assert len(kept) > 200
    assert kept == list(range(1, len(kept) + 1))
