"""Fleet files: the cascade, and mistakes reported where they were made."""

import contextlib
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from config.advice import warnings
from config.loader import (
    FleetFileError,
    dump_effective,
    expand_channel,
    load_fleet,
    resolve_fleet,
    runtime_dir,
    shipped_fleet_path,
    shipped_fleets,
)
from tests.config.fleet_files import SMALL, loaded, small, spoilt, written

MANY_EXAMPLES = settings(
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def complaint(folder: Path, content: str | dict[str, Any]) -> str:
    """What the loader says against the content, without the folder's name."""
    with pytest.raises(FleetFileError) as caught:
        loaded(folder, content)
    return str(caught.value).replace(f"{folder}/", "")


class TestCascade:
    def test_a_robot_wins_over_its_type_and_the_type_over_the_defaults(
        self, tmp_path: Path
    ) -> None:
        data = small()
        data["types"]["car"]["limits"] = {"speed_mps": 3, "steering_rad": 0.5}
        data["robots"]["r2"]["limits"] = {"speed_mps": 4}
        fleet = loaded(tmp_path, data)
        limits = {name: robot.limits for name, robot in fleet.robots.items()}
        assert [limits[name].speed_mps for name in ("r1", "r2")] == [3, 4]
        assert limits["r2"].steering_rad == 0.5
        assert limits["r2"].acceleration_mps2 == 2

    def test_lists_are_replaced_as_a_whole(self, tmp_path: Path) -> None:
        data = small()
        data["defaults"]["markers"] = [{"id": 1, "x_m": 0, "y_m": 0}, {"id": 2, "x_m": 1, "y_m": 0}]
        markers = loaded(tmp_path, data).robots["r1"].markers
        assert [marker.id for marker in markers] == [11]

    def test_a_robot_may_go_without_a_type(self, tmp_path: Path) -> None:
        data = small()
        data["defaults"] |= data.pop("types")["car"]
        for robot in data["robots"].values():
            del robot["type"]
        assert loaded(tmp_path, data) == loaded(tmp_path, SMALL)

    def test_null_takes_a_setting_back(self, tmp_path: Path) -> None:
        data = small()
        data["defaults"] |= {"leader": "r1", "offset": {"x_m": -0.5, "y_m": 0}}
        data["robots"]["r1"] |= {"leader": None, "offset": None}
        assert loaded(tmp_path, data).robots["r1"].leader is None

    def test_plain_numbers_may_use_exponents(self, tmp_path: Path) -> None:
        assert loaded(tmp_path, spoilt("node: 1", "node: 1").replace("0.25", "25e-2")) == loaded(
            tmp_path, SMALL
        )

    def test_the_effective_file_loads_to_an_equal_fleet(self, tmp_path: Path) -> None:
        fleet = loaded(tmp_path, SMALL)
        text = dump_effective(fleet)
        assert loaded(tmp_path, text) == fleet
        assert dump_effective(loaded(tmp_path, text)) == text

    def test_keeps_the_source_and_the_settings_as_written(self, tmp_path: Path) -> None:
        path = written(tmp_path, SMALL)
        result = load_fleet(path)
        assert result.source_path == path
        assert isinstance(result.raw_effective, dict)
        assert set(result.raw_effective) == {"version", "name", "landmarks", "mission", "robots"}


class TestMistakes:
    def test_an_unknown_key_is_shown_in_its_line_with_the_nearest_key(self, tmp_path: Path) -> None:
        text = complaint(tmp_path, spoilt("    markers: [{id: 21", "    markrs: [{id: 21"))
        assert "fleet.yaml:31:5: robots.r2.markrs: unknown key; did you mean `markers`?" in text
        assert "\n        markrs: [{id: 21, x_m: 0, y_m: 0}]\n        ^" in text
        assert "fleet.yaml:26:3: robots.r2: `markers` is missing" in text

    def test_an_inherited_mistake_is_reported_once_where_it_was_written(
        self, tmp_path: Path
    ) -> None:
        text = complaint(tmp_path, spoilt("speed_mps: 2", "speed_mps: -2"))
        expected = "fleet.yaml:10:16: defaults.limits.speed_mps: -2 is not allowed: "
        assert text.startswith(expected + "must be greater than 0\n")
        assert text.count("speed_mps: -2 is") == 1

    def test_all_mistakes_are_reported_at_once_in_the_order_of_the_file(
        self, tmp_path: Path
    ) -> None:
        data = spoilt("name: small", "name: Small Fleet\ngrund: x")
        data = data.replace("wheelbase_m: 0.25", "wheelbase_m: short")
        data = data.replace("node: 2", "node: 63")
        data = data.replace("leader: r2", "leader: [r2]")
        with pytest.raises(FleetFileError) as caught:
            loaded(tmp_path, data)
        assert [problem.path for problem in caught.value.problems] == [
            "name",
            "grund",
            "types.car.vehicle.wheelbase_m",
            "types.car.vehicle.drive.node",
            "robots.r3.leader",
        ]
        places = [problem.place for problem in caught.value.problems]
        assert places == sorted(places)

    def test_an_unknown_key_does_not_hide_a_cycle_of_leaders(self, tmp_path: Path) -> None:
        data = small()
        data["robots"]["r2"]["leader"] = "r3"
        data["robots"]["r1"]["colour"] = "red"
        text = complaint(tmp_path, data)
        assert (
            "robots.r1.colour: unknown key; known here: arming, bearing_sensor, black_box, can"
            in text
        )
        assert "r2 -> r3 -> r2" in text

    def test_an_unknown_type_is_named_and_not_blamed_for_what_it_would_have_given(
        self, tmp_path: Path
    ) -> None:
        text = complaint(tmp_path, spoilt("type: car", "type: cra"))
        assert "robots.r1.type: no type 'cra'; did you mean 'car'?" in text
        assert text.count("fleet.yaml:") == 1

    def test_a_type_that_no_robot_uses_is_checked_too(self, tmp_path: Path) -> None:
        data = small()
        data["types"]["van"] = {"vehicle": {"wheelbase_m": 0}, "limit": {}}
        text = complaint(tmp_path, data)
        assert "types.van.vehicle.wheelbase_m: 0 is not allowed" in text
        assert "types.van.limit: unknown key; did you mean `limits`?" in text

    def test_a_wrong_choice_names_the_nearest(self, tmp_path: Path) -> None:
        text = complaint(tmp_path, spoilt("  can:", "  formation: {law: leaderframe}\n  can:"))
        assert "'leaderframe' is not allowed: must be 'leader_frame' or 'polar'" in text
        assert "did you mean 'leader_frame'?" in text

    @pytest.mark.parametrize("word", ["on", "yes", "true", "1:30", "2026-01-01", ".nan", ".inf"])
    def test_only_finite_numbers_pass_as_numbers(self, tmp_path: Path, word: str) -> None:
        text = complaint(tmp_path, spoilt("wheelbase_m: 0.25", f"wheelbase_m: {word}"))
        assert "fleet.yaml:18:20: types.car.vehicle.wheelbase_m: " in text

    def test_a_key_given_twice_is_refused(self, tmp_path: Path) -> None:
        text = complaint(tmp_path, spoilt("  r2:", "  r1:"))
        assert "fleet.yaml:26:3: robots.r1: given twice, first in line 22: keep one" in text

    def test_another_version_is_the_only_complaint(self, tmp_path: Path) -> None:
        text = complaint(tmp_path, spoilt("version: 1", "version: 2").replace("node", "knot"))
        assert text.startswith("fleet.yaml:1:10: version: this program reads version 1 only")
        assert text.count("fleet.yaml:") == 1

    @pytest.mark.parametrize(
        ("content", "expected"),
        [
            ("", "fleet.yaml: empty"),
            ("# only a comment\n", "fleet.yaml: empty"),
            ("- r1\n- r2\n", "fleet.yaml:1:1: a fleet file is a mapping"),
            ("just words\n", "fleet.yaml:1:1: a fleet file is a mapping"),
            ("version: 1\n\tname: x\n", "fleet.yaml:2:1: not YAML: found character '\\t'"),
            ("version: 1\nrobots: [a, b\n", "fleet.yaml:3:1: not YAML: "),
            ("a: 1\n---\nb: 2\n", "fleet.yaml:2:1: not YAML: "),
            ("a: \x07\n", "fleet.yaml:1:1: not YAML: "),
            ("a: &x [*x]\n", "an alias that leads to itself"),
            ("a: !!python/name:os.system ''\n", "has no meaning here"),
            ("a: !thing 1\n", "tag !thing has no meaning here"),
            ("? [a]\n: 1\n", "a key must be a plain word"),
            ("a: &a {b: 1}\nc:\n  <<: *a\n", "merge keys are not read"),
            ("[" * 1000, "nested too deeply"),
            ("version: 1\nrobots: 3\n", "robots: 3 is not allowed: must be a mapping"),
            ("version: 1\ndefaults: [1]\n", "defaults: must be a mapping"),
            ("version: 1\ntypes: {car: 1}\n", "types.car: must be a mapping"),
            ("version: 1\nrobots: {r1: 1}\n", "robots.r1: must be a mapping"),
            ("version: 1\nrobots: {r1: {type: [1]}}\n", "robots.r1.type: no type"),
        ],
    )
    def test_what_is_no_fleet_file_is_said_plainly(
        self, tmp_path: Path, content: str, expected: str
    ) -> None:
        assert expected in complaint(tmp_path, content)

    def test_a_bomb_of_aliases_is_refused_quickly(self, tmp_path: Path) -> None:
        rows = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
        rows += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 10)]
        assert "too many values" in complaint(tmp_path, "\n".join(rows))

    def test_files_that_cannot_be_read_are_named(self, tmp_path: Path) -> None:
        binary = tmp_path / "binary.yaml"
        binary.write_bytes(b"version: \xff\xfe")
        for path in (binary, tmp_path, tmp_path / "missing.yaml", Path("nul\0byte")):
            with pytest.raises(FleetFileError, match=path.name.split("\0")[0]):
                load_fleet(path)


keys = st.text(st.characters(codec="ascii", categories=("L", "N")), min_size=1, max_size=12)
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3),
    max_leaves=5,
)


def every_path(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all values in nested data, the outermost excepted."""
    if isinstance(value, dict):
        children = list(value.items())
    elif isinstance(value, list):
        children = list(enumerate(value))
    else:
        children = []
    found = [(*path, key) for key, _ in children]
    for key, child in children:
        found += every_path(child, (*path, key))
    return found


PATHS = every_path(small())


class TestAnyMistake:
    @MANY_EXAMPLES
    @given(place=st.sampled_from(["", "defaults", "types.car", "robots.r1", "mission"]), key=keys)
    def test_an_unknown_key_anywhere_is_named(self, tmp_path: Path, place: str, key: str) -> None:
        data = small()
        section = data
        for part in place.split(".") if place else []:
            section = section[part]
        name = f"{key}X"
        section[name] = 1
        text = complaint(tmp_path, data)
        assert f"{place}.{name}: unknown key; ".removeprefix(".") in text

    @MANY_EXAMPLES
    @given(path=st.sampled_from(PATHS), value=values)
    def test_any_value_anywhere_loads_or_is_a_fleet_file_error(
        self, tmp_path: Path, path: tuple[Any, ...], value: Any
    ) -> None:
        data = small()
        owner: Any = data
        for key in path[:-1]:
            owner = owner[key]
        owner[path[-1]] = value
        with contextlib.suppress(FleetFileError):
            loaded(tmp_path, data)

    @MANY_EXAMPLES
    @given(start=st.integers(0, len(SMALL)), length=st.integers(0, 40), new=st.text(max_size=5))
    def test_any_edit_of_the_text_loads_or_is_a_fleet_file_error(
        self, tmp_path: Path, start: int, length: int, new: str
    ) -> None:
        with contextlib.suppress(FleetFileError):
            loaded(tmp_path, SMALL[:start] + new + SMALL[start + length :])


class TestShippedFleets:
    def test_there_are_three(self) -> None:
        assert shipped_fleets() == ["demo", "hardware", "paper"]

    @pytest.mark.parametrize("name", ["demo", "hardware", "paper"])
    def test_they_load_under_their_name_without_warnings(self, name: str) -> None:
        fleet = load_fleet(resolve_fleet(name)).fleet
        assert fleet.name == name
        assert warnings(fleet) == []
        assert list(fleet.robots) == ["r1", "r2", "r3"]
        assert [len(robot.markers) for robot in fleet.robots.values()] == [2, 2, 2]

    @pytest.mark.parametrize("name", ["demo", "hardware", "paper"])
    def test_their_effective_files_load_to_equal_fleets(self, name: str, tmp_path: Path) -> None:
        fleet = load_fleet(resolve_fleet(name)).fleet
        assert loaded(tmp_path, dump_effective(fleet)) == fleet

    def test_they_drive_the_same_path_at_different_speeds(self) -> None:
        def lengths_and_turns(name: str) -> list[float]:
            segments = load_fleet(resolve_fleet(name)).fleet.mission.segments
            lengths = [segment.duration_s * segment.speed_mps for segment in segments]
            return lengths + [s.duration_s * s.fork_rate_radps for s in segments]

        paper = [16.0, 12.0, 8.0, -4 * math.pi / 3, math.pi, 0.0]
        for name in shipped_fleets():
            assert lengths_and_turns(name) == pytest.approx(paper, abs=1e-3)

    def test_a_name_or_a_path_leads_to_a_file(self, tmp_path: Path) -> None:
        path = written(tmp_path, SMALL)
        assert resolve_fleet(str(path)) == path
        assert resolve_fleet("paper") == shipped_fleet_path("paper")

    def test_a_wrong_name_is_answered_with_the_nearest(self, tmp_path: Path) -> None:
        with pytest.raises(FleetFileError, match="did you mean 'paper'"):
            resolve_fleet("papr")
        with pytest.raises(FleetFileError, match="demo, hardware, paper"):
            shipped_fleet_path("zzz")
        with pytest.raises(FleetFileError, match="a folder"):
            resolve_fleet(tmp_path)


class TestChannels:
    def test_placeholders_are_filled_in(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/7")
        fleet = load_fleet(resolve_fleet("demo")).fleet
        assert expand_channel(fleet, "r2") == "/run/user/7/echelon/demo/r2.sock"

    def test_without_a_runtime_folder_each_user_has_one_in_tmp(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
        monkeypatch.setattr("os.getuid", lambda: 42)
        assert runtime_dir() == Path("/tmp/echelon-42")
