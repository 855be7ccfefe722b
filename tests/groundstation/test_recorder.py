"""The recording is a valid MCAP file that viewers accept, the same bytes from the same calls."""

import json
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from config import topics
from groundstation.errors import GroundError
from groundstation.json_schema import inlined_schema
from groundstation.recorder import About, Recorder
from groundstation.series import read_run
from tests.groundstation.synthetic import WALL_NS, Story, fleet, messages

ABOUT = About(WALL_NS, "lockstep", 1)


def _recorder(path: Path) -> Recorder:
    return Recorder(path, fleet(), ABOUT)


def _record(path: Path, flush_every: int = 0) -> list[tuple[str, bytes, int]]:
    written = list(messages(Story(duration_s=2.0)))
    with _recorder(path) as recorder:
        for number, message in enumerate(written):
            recorder.write(*message)
            if flush_every and number % flush_every == 0:
                recorder.flush()
    return written


def test_a_recording_holds_every_message_verbatim_under_its_key(tmp_path: Path) -> None:
    written = _record(tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as stream:
        read = [
            (channel.topic, message.data, message.log_time)
            for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages()
            if "/" in channel.topic
        ]
    assert sorted(read) == sorted(written)


def test_the_final_name_appears_only_when_the_file_is_whole(tmp_path: Path) -> None:
    recorder = _recorder(tmp_path / "run.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap.active"]
    recorder.close()
    recorder.close()
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


def test_flushed_messages_are_in_the_file_before_it_is_closed(tmp_path: Path) -> None:
    key, payload, time_ns = next(messages(Story()))
    with _recorder(tmp_path / "run.mcap") as recorder:
        before = (tmp_path / "run.mcap.active").stat().st_size
        recorder.write(key, payload, time_ns)
        recorder.flush()
        assert (tmp_path / "run.mcap.active").stat().st_size > before


def test_the_same_messages_make_the_same_bytes(tmp_path: Path) -> None:
    _record(tmp_path / "a.mcap")
    _record(tmp_path / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_a_key_outside_the_registry_is_refused(tmp_path: Path) -> None:
    with (
        _recorder(tmp_path / "run.mcap") as recorder,
        pytest.raises(ValueError, match="echelon/pair/r1/colour"),
    ):
        recorder.write("echelon/pair/r1/colour", b"{}", 0)


@pytest.mark.parametrize("topic", topics.PUBLISHED, ids=lambda topic: topic.name)
def test_schemas_are_self_contained_objects_with_one_type_per_field(topic: topics.Topic) -> None:
    schema = json.loads(inlined_schema(topic.message))
    assert schema["type"] == "object"
    assert set(schema["properties"]) == {
        field.encode_name for field in msgspec.structs.fields(topic.message)
    }
    assert _untyped(schema) == []


def _untyped(schema: dict[str, object]) -> list[object]:
    """Every field or item whose schema has no type of its own, at any depth."""
    found: list[object] = [] if isinstance(schema.get("type"), str) else [schema]
    properties, items = schema.get("properties"), schema.get("items")
    if isinstance(properties, dict):
        found += [bad for each in properties.values() for bad in _untyped(each)]
    if isinstance(items, dict):
        found += _untyped(items)
    return found


def test_a_recording_reads_back_as_series(tmp_path: Path) -> None:
    _record(tmp_path / "run.mcap", flush_every=50)
    run = read_run(tmp_path / "run.mcap")
    assert run.truth["r1"].x_m[50] == pytest.approx(1.0)
    assert run.truth["r2"].x_m[50] == pytest.approx(0.0)
    assert run.motion["r1"][-1].reason == "mission complete"


def test_an_unfinished_recording_is_refused_with_its_name(tmp_path: Path) -> None:
    _record(tmp_path / "run.mcap")
    whole = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "run.mcap").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(GroundError, match=r"run\.mcap is not a whole"):
        read_run(tmp_path / "run.mcap")


def test_a_missing_recording_is_refused_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(GroundError, match=r"nothing\.mcap"):
        read_run(tmp_path / "nothing.mcap")
