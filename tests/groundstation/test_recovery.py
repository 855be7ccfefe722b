"""What a killed or damaged recorder leaves is made whole again; nothing makes recovery raise."""

import random
from pathlib import Path

import pytest
from mcap.reader import make_reader

from groundstation.errors import GroundError
from groundstation.recorder import About, Recorder
from groundstation.recording import read_messages
from groundstation.recovery import recover, save_left_behind
from tests.groundstation.synthetic import WALL_NS, Story, fleet, messages
from tests.recorder_kill import LIMIT_S, kill_one

FLUSH_EVERY = 50
CASES = 60


def _write(path: Path, finished: bool = True) -> list[tuple[str, bytes, int]]:
    """A recording of 2 s, one chunk for every 50 messages."""
    written = list(messages(Story(duration_s=2.0)))
    recorder = Recorder(path, fleet(), About(WALL_NS, "lockstep", 1))
    for number, message in enumerate(written):
        recorder.write(*message)
        if number % FLUSH_EVERY == FLUSH_EVERY - 1:
            recorder.flush()
    if finished:
        recorder.close()
    return written


def _valid(path: Path) -> int:
    """Read all of a file with all its check sums; how many messages it has."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_summary() is not None
        return sum(1 for _ in reader.iter_messages())


@pytest.mark.parametrize("kind", ["truncated", "flipped"])
def test_recovery_of_damaged_recordings_never_raises_and_its_output_is_valid(
    kind: str, tmp_path: Path
) -> None:
    _write(tmp_path / "whole.mcap")
    whole, moments = (tmp_path / "whole.mcap").read_bytes(), random.Random(5)
    magic = 8
    kept = []
    for number in range(CASES):
        at = moments.randrange(magic, len(whole))
        data = bytearray(whole[:at] if kind == "truncated" else whole)
        if kind == "flipped":
            data[at] ^= 1 << moments.randrange(8)
        path = tmp_path / f"{number}.mcap.active"
        path.write_bytes(data)
        recovered = recover(path)
        assert _valid(tmp_path / f"{number}.mcap") == recovered.messages
        kept.append(recovered.messages)
    everything = _valid(tmp_path / "whole.mcap")
    assert max(kept) <= everything
    # A flip costs its chunk only, unless it is the first with the schemas.
    assert kind == "truncated" or sum(each > 0.8 * everything for each in kept) > 0.8 * CASES


def test_what_was_flushed_is_recovered_in_full(tmp_path: Path) -> None:
    written = _write(tmp_path / "run.mcap", finished=False)
    copy = tmp_path / "copy.mcap.active"
    copy.write_bytes((tmp_path / "run.mcap.active").read_bytes())
    recover(copy)
    found = [
        (each.key, each.payload, each.wall_ns)
        for each in read_messages(tmp_path / "copy.mcap")
        if "/" in each.key
    ]
    assert not copy.exists()
    whole_chunks = len(written) // FLUSH_EVERY * FLUSH_EVERY
    assert sorted(found) == sorted(written[:whole_chunks])


def test_a_damaged_chunk_costs_itself_and_the_original_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    _write(path)
    data = bytearray(path.read_bytes())
    chunks = [at for at in range(len(data)) if data.startswith(b"\x04\x00\x00\x00zstd", at)]
    data[chunks[4] + 100] ^= 0xFF
    everything = _valid(path)
    path.write_bytes(data)
    with pytest.raises(GroundError, match=r"run\.mcap is damaged.*echelon recover"):
        list(read_messages(path))
    recovered = recover(path)
    assert recovered.lost_chunks == 1
    assert 0 < everything - _valid(path) < 2 * FLUSH_EVERY
    assert (tmp_path / "run.mcap.damaged").read_bytes() == data


def test_a_recording_that_is_still_written_is_left_alone(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.mcap", fleet(), About(WALL_NS, "lockstep", 1)):
        assert save_left_behind(tmp_path) == []
        with pytest.raises(GroundError, match="still being written"):
            recover(tmp_path / "run.mcap.active")
    assert _valid(tmp_path / "run.mcap") > 0


def test_the_next_start_saves_what_a_killed_recorder_left(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    _write(tmp_path / "source.mcap")
    data = (tmp_path / "source.mcap").read_bytes()
    (tmp_path / "old" / "run.mcap.active").write_bytes(data[: len(data) // 2])
    (told,) = save_left_behind(tmp_path)
    assert "old/run.mcap: " in told
    assert _valid(tmp_path / "old" / "run.mcap") > 0
    assert save_left_behind(tmp_path) == []


def test_an_existing_recording_is_never_overwritten(tmp_path: Path) -> None:
    _write(tmp_path / "run.mcap")
    before = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "run.mcap.active").write_bytes(before[:500])
    with pytest.raises(GroundError, match="exists already"):
        recover(tmp_path / "run.mcap.active")
    with pytest.raises(GroundError, match="there is a recording of that name"):
        Recorder(tmp_path / "run.mcap", fleet(), About(WALL_NS, "lockstep", 1))
    assert (tmp_path / "run.mcap").read_bytes() == before


@pytest.mark.process
@pytest.mark.parametrize("after_s", [0.73, 1.31])
def test_a_killed_recorder_loses_little(after_s: float, tmp_path: Path) -> None:
    killed = kill_one(tmp_path / "run.mcap", after_s)
    assert killed.recovered > 0
    assert killed.gaps == 0
    assert killed.missing_s <= LIMIT_S
