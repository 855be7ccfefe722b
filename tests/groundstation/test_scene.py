"""What viewers of recordings draw is where the messages say that robots are."""

import json
import math
from pathlib import Path

import pytest

from config.messages import Event, encode
from config.topics import EVENT
from groundstation import keys
from groundstation.scene import LOG, MAP, SCENE, TF, Scene
from groundstation.viewer_layout import layout
from groundstation.viewer_messages import FrameTransforms, Log, SceneUpdate
from tests.groundstation.synthetic import WALL_NS, Place, Story, behind, fleet, messages
from tests.hil.fleets import shipped

DOCS = Path(__file__).parents[2] / "docs"
Frames = dict[str, tuple[str, float, float, float]]


def _drawn(story: Story) -> tuple[Frames, dict[str, SceneUpdate], int]:
    """The last transform of every frame, the last update with each entity, how many updates."""
    scene, frames, entities, updates = Scene(fleet()), Frames(), {}, 0
    for key, body, wall_ns in messages(story):
        for topic, message in scene.hear(keys.parse(key), body, wall_ns):
            if isinstance(message, FrameTransforms):
                assert topic == TF
                for each in message.transforms:
                    angle = 2 * math.atan2(each.rotation.z, each.rotation.w)
                    place = each.translation
                    frames[each.child_frame_id] = (each.parent_frame_id, place.x, place.y, angle)
            elif isinstance(message, SceneUpdate):
                assert topic == SCENE
                updates += 1
                entities.update({each.id: message for each in message.entities})
    return frames, entities, updates


def _in_map(frames: Frames, name: str) -> Place:
    """A frame's pose through its parents, by plane geometry."""
    x, y, angle = 0.0, 0.0, 0.0
    while name != MAP:
        name, dx, dy, turned = frames[name]
        cos, sin = math.cos(turned), math.sin(turned)
        x, y, angle = dx + cos * x - sin * y, dy + sin * x + cos * y, angle + turned
    return Place(x, y, angle)


@pytest.mark.parametrize("heading_rad", [0.0, 0.4, -2.0])
def test_frames_chain_up_to_where_robots_are_and_believe_to_be(heading_rad: float) -> None:
    story = Story(follower=behind(heading_rad=heading_rad), duration_s=2.0)
    frames, _, _ = _drawn(story)
    true, believed = _in_map(frames, "truth/r2"), _in_map(frames, "r2")
    assert (true.x_m, true.y_m) == pytest.approx((1.0, 0.5), abs=0.03)
    # The story's follower believes its leader 0.1 m too far and 0.02 rad too far left.
    assert math.hypot(believed.x_m - true.x_m, believed.y_m - true.y_m) < 0.14
    assert math.remainder(believed.heading_rad - heading_rad, math.tau) == pytest.approx(0.0)


def test_the_scene_shows_robots_truth_places_and_landmarks_five_times_a_second() -> None:
    _, entities, updates = _drawn(Story(duration_s=4.0))
    assert set(entities) >= {
        "r1",
        "r2",
        "truth/r1",
        "truth/r2",
        "landmarks",
        "r2 wanted",
        "r2 95 %",
    }
    assert updates == pytest.approx(20, abs=2)


def test_events_become_lines_of_the_log() -> None:
    event = Event(seq=0, t_ns=0, wall_ns=WALL_NS, source="r2", severity="error", text="no bearing")
    key = EVENT.key("pair", "r2")
    ((topic, line),) = Scene(fleet()).hear(keys.parse(key), encode(event), WALL_NS)
    assert topic == LOG
    assert isinstance(line, Log)
    assert (line.level, line.name, line.message) == (4, "r2", "no bearing")
    assert line.timestamp.sec == WALL_NS // 10**9


def test_the_shipped_layout_is_that_of_the_demo_fleet() -> None:
    text = (DOCS / "viewer-layout.json").read_text(encoding="utf-8")
    assert text == layout(shipped("demo"))
    panels = json.loads(text)["configById"]
    assert panels["3D!scene"]["topics"] == {TF: {"visible": True}, SCENE: {"visible": True}}
