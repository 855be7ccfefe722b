"""The recording is a valid MCAP file that viewers accept, the same bytes from the same calls."""

import json
import resource
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer
from typer.testing import CliRunner

from config import topics
from groundstation.cli import app
from groundstation.errors import GroundError
from groundstation.json_schema import inlined_schema
from groundstation.recorder import About, Limits, Recorder
from groundstation.recording import read_info, read_messages, recorded_fleet
from groundstation.recording_format import INFO
from groundstation.recovery import recover
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


def test_every_channel_follows_the_rules_of_viewers(tmp_path: Path) -> None:
    _record(tmp_path / "run.mcap")
    with (tmp_path / "run.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert {"tf", "scene", "log", "recording"} < {each.topic for each in summary.channels.values()}
    names = set()
    for channel in summary.channels.values():
        assert channel.message_encoding == "json"
        schema = summary.schemas[channel.schema_id]
        assert schema.encoding == "jsonschema"
        assert b"$ref" not in schema.data
        assert _violations(json.loads(schema.data), top=True) == []
        names.add(schema.name)
    assert names > {"foxglove.FrameTransforms", "foxglove.SceneUpdate", "foxglove.Log"}


def test_every_topic_of_the_registry_has_a_schema_that_viewers_accept() -> None:
    for topic in topics.PUBLISHED:
        schema = json.loads(inlined_schema(topic.message))
        assert _violations(schema, top=True) == []
        assert set(schema["properties"]) == {
            field.encode_name for field in msgspec.structs.fields(topic.message)
        }


def _violations(schema: object, top: bool = False) -> list[str]:
    """What Foxglove's and Lichtblick's JSON parser would refuse, at any depth."""
    if not isinstance(schema, dict):
        return [f"not a schema: {schema}"]
    if any(word in schema for word in ("$ref", "anyOf", "oneOf", "allOf")):
        return [f"not inlined: {schema}"]
    kind = schema.get("type")
    if top and kind != "object":
        return [f"not an object: {kind}"]
    if kind == "object":
        fields = schema.get("properties")
        if not isinstance(fields, dict):
            return ["an object without properties"]
        return [bad for each in fields.values() for bad in _violations(each)]
    if kind == "array":
        items = schema.get("items")
        if isinstance(items, dict) and items.get("type") == "array":
            return ["an array of arrays"]
        return _violations(items)
    known = ("boolean", "string", "number", "integer")
    return [] if kind in known else [f"unknown type {kind}"]


def test_the_first_chunk_holds_all_schemas_and_is_written_at_once(tmp_path: Path) -> None:
    with _recorder(tmp_path / "run.mcap"):
        data = (tmp_path / "run.mcap.active").read_bytes()
        records = StreamReader(BytesIO(data), emit_chunks=True).records
        chunk = next(each for each in records if isinstance(each, Chunk))
        inside = breakup_chunk(chunk, validate_crc=True)
    schemas = {each.name for each in inside if isinstance(each, Schema)}
    assert schemas >= {f"echelon.{topic.message.__name__}" for topic in topics.PUBLISHED}
    assert any(isinstance(each, Message) for each in inside)


def test_a_recording_says_what_it_holds(tmp_path: Path) -> None:
    _record(tmp_path / "run.mcap")
    info = read_info(tmp_path / "run.mcap")
    assert (info.version, info.fleet_name, info.mode, info.seed) == (1, "pair", "lockstep", 1)
    assert recorded_fleet(info) == fleet()


def test_a_large_recording_goes_on_in_further_parts_and_reads_as_one(tmp_path: Path) -> None:
    written = list(messages(Story(duration_s=2.0)))
    limits = Limits(part_mb=0.02, keep_free_mb=0.0)
    with Recorder(tmp_path / "run.mcap", fleet(), ABOUT, limits) as recorder:
        for number, message in enumerate(written):
            recorder.write(*message)
            if number % 100 == 0:
                recorder.flush()
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names[0] == "run-0002.mcap"
    assert len(names) > 2
    read = [(m.key, m.payload, m.wall_ns) for m in read_messages(tmp_path / "run.mcap")]
    assert sorted(each for each in read if "/" in each[0]) == sorted(written)
    assert recorder.take_notes() == []


def test_a_full_disk_is_told_once_and_recording_goes_on_when_there_is_room(
    tmp_path: Path,
) -> None:
    written = list(messages(Story(duration_s=1.0)))
    later_ns = written[-1][2] + 6_000_000_000
    recorder = Recorder(tmp_path / "run.mcap", fleet(), ABOUT, Limits(keep_free_mb=0.0))
    with _largest_file(20_000):
        for number, message in enumerate(written * 4):
            recorder.write(*message)
            if number % 50 == 0:
                recorder.flush()
        (told,) = recorder.take_notes()
    assert "nothing is recorded any more" in told
    assert "File too large" in told
    assert recorder.problem is not None
    assert recorder.dropped > 0
    recorder.write(written[0][0], written[0][1], later_ns)
    recorder.flush()
    assert recorder.problem is None
    assert "recording goes on" in recorder.take_notes()[0]
    recorder.write(written[0][0], written[0][1], later_ns)
    recorder.close()
    assert [m.key for m in read_messages(tmp_path / "run-0002.mcap")][-1] == written[0][0]
    recover(tmp_path / "run.mcap.active")
    assert len(list(read_messages(tmp_path / "run.mcap"))) > 1


@contextmanager
def _largest_file(size: int) -> Iterator[None]:
    """Let the operating system refuse to make any file larger."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_the_last_of_the_disk_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free_mb = 150.0
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=round(free_mb * 1e6)))
    recorder = _recorder(tmp_path / "run.mcap")
    written = list(messages(Story(duration_s=0.1)))
    recorder.write(*written[0])
    recorder.flush()
    assert "150 MB free" in recorder.take_notes()[0]
    assert (tmp_path / "run.mcap").exists()
    recorder.write(*written[1])
    free_mb = 390.0
    recorder.flush()
    assert recorder.problem is not None
    free_mb = 410.0
    recorder.flush()
    assert recorder.problem is None
    assert "1 messages are missing" in recorder.take_notes()[0]
    recorder.close()
    assert len(read_run(tmp_path / "run.mcap").truth) == 1


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(GroundError, match=r"cannot record: .*nowhere"):
        _recorder(tmp_path / "nowhere" / "run.mcap")


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


def _foreign(path: Path, profile: str, version: int | None) -> None:
    """An MCAP file of that profile, with a first message that names that format version."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start(profile=profile)
        schema = writer.register_schema("any", "jsonschema", b"{}")
        channel = writer.register_channel(INFO if version else "chatter", "json", schema)
        told: dict[str, object] = {
            "version": version,
            "wall_ns": 0,
            "part": 1,
            "fleet_name": "x",
            "fleet_json": "{}",
            "mode": "lockstep",
            "seed": 1,
            "versions": [],
        }
        writer.add_message(channel, 0, json.dumps(told).encode(), 0)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves it without types


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda path: path.write_bytes(b""), "is empty"),
        (lambda path: path.write_bytes(b"no MCAP at all" * 10), "is no MCAP file"),
        (lambda path: path.mkdir(), "Is a directory"),
        (lambda path: _foreign(path, "ros2", None), "profile 'ros2'"),
        (lambda path: _foreign(path, "echelon", None), "no Echelon recording"),
        (lambda path: _foreign(path, "echelon", 7), "format version 7, this program reads"),
    ],
)
def test_a_file_that_is_no_recording_is_refused_in_one_message(
    make: Callable[[Path], object], told: str, tmp_path: Path
) -> None:
    path = tmp_path / "bad.mcap"
    make(path)
    for command in (["replay", "--check"], ["report"]):
        result = CliRunner().invoke(app, [*command, str(path), "--json"])
        assert result.exit_code == 2
        assert told in result.stderr
        assert "bad.mcap" in result.stderr
        assert told in json.loads(result.stdout)["error"]
