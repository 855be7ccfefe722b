"""A recording plays, pauses, jumps and changes its speed by the clock it is given."""

from pathlib import Path

import pytest

from groundstation.errors import GroundError
from groundstation.player import Player, Row, open_player
from groundstation.recorder import About, Recorder
from groundstation.replay_page import PREFIX, RecordedSource
from tests.groundstation.synthetic import WALL_NS, Story, fleet, messages

LENGTH_S = 4.0


def _rows() -> list[Row]:
    return [
        Row((wall_ns - WALL_NS) * 1e-9, key, body)
        for key, body, wall_ns in messages(Story(duration_s=LENGTH_S))
    ]


def _player() -> Player:
    return Player(_rows(), now_s=100.0)


def test_nothing_plays_before_it_is_told_to() -> None:
    player = _player()
    assert player.due(105.0) == []
    assert player.position_s(105.0) == 0.0


@pytest.mark.parametrize("speed", [0.1, 1.0, 2.5, 10.0])
def test_messages_come_when_their_time_comes_at_any_speed(speed: float) -> None:
    player, rows = _player(), _rows()
    player.set_speed(100.0, speed)
    player.play(100.0)
    elapsed_s = 2.01 / speed
    played = player.due(100.0 + elapsed_s / 2) + player.due(100.0 + elapsed_s)
    expected = [row for row in rows if row.time_s < 2.01]
    assert [(each.time_s, each.key, each.payload) for each in played] == expected
    assert player.position_s(100.0 + elapsed_s) == pytest.approx(2.01)


def test_a_pause_holds_the_place_and_playing_goes_on_from_there() -> None:
    player = _player()
    player.play(100.0)
    player.due(101.0)
    player.pause(101.0)
    assert player.due(200.0) == []
    assert player.position_s(200.0) == pytest.approx(1.0)
    player.play(200.0)
    assert [each.time_s for each in player.due(200.5)][-1] == pytest.approx(1.5, abs=0.021)


def test_a_change_of_speed_moves_nothing() -> None:
    player = _player()
    player.play(100.0)
    player.set_speed(101.0, 10.0)
    assert player.position_s(101.0) == pytest.approx(1.0)
    assert player.position_s(101.1) == pytest.approx(2.0)


@pytest.mark.parametrize("speed", [0.0, 0.05, 11.0, -1.0])
def test_speeds_outside_a_tenth_to_ten_are_refused(speed: float) -> None:
    with pytest.raises(GroundError, match=r"between 0\.1 and 10"):
        _player().set_speed(100.0, speed)


def test_a_jump_shows_the_latest_message_of_every_key() -> None:
    player = _player()
    shown = player.seek(100.0, 3.0)
    assert len({each.key for each in shown}) == len(shown) == 6
    assert [each.time_s for each in shown] == pytest.approx([2.98] * 6)
    player.play(100.0)
    assert min(each.time_s for each in player.due(100.1)) == pytest.approx(3.0)
    assert player.seek(100.2, -5.0) == []
    player.seek(100.3, 99.0)
    assert player.position_s(100.3) == player.duration_s


def test_it_stops_at_the_end_and_plays_again_from_the_beginning() -> None:
    player = _player()
    player.play(100.0)
    player.due(100.0 + 2 * LENGTH_S)
    assert player.ended
    assert not player.playing
    player.play(200.0)
    assert player.position_s(200.0) == 0.0
    assert player.due(200.0)


def test_the_page_gets_a_recording_under_keys_that_no_robot_has(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with Recorder(path, fleet(), About(WALL_NS, "lockstep", 1)) as recorder:
        for message in messages(Story(duration_s=LENGTH_S)):
            recorder.write(*message)
    clock = [50.0]
    source = RecordedSource(open_player(path, 50.0), lambda: clock[0])
    source.play()
    clock[0] = 51.0
    arrived = source.poll()
    assert {each.key.split("/")[0] + "/" for each in arrived} == {PREFIX}
    assert not PREFIX.startswith(("echelon/", "truth/", "sim/"))
    assert arrived[-1].time_s == pytest.approx(WALL_NS * 1e-9 + 1.0, abs=0.021)
    assert source.now_s() == pytest.approx(WALL_NS * 1e-9 + 1.0)
    epoch = source.epoch
    source.seek(3.0)
    assert source.epoch != epoch
    assert {round(each.time_s - WALL_NS * 1e-9, 2) for each in source.poll()} == {2.98, 3.0}
    state = source.state()
    assert state.position_s == pytest.approx(3.0)
    assert (state.playing, state.speed) == (True, 1.0)


def test_a_recording_with_nothing_to_show_is_refused(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run.mcap", fleet(), About(WALL_NS, "lockstep", 1)):
        pass
    with pytest.raises(GroundError, match="nothing to show"):
        open_player(tmp_path / "run.mcap", 0.0)
