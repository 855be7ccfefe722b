"""A recording on the page, in a real browser: play, pause, seek, speed, and no commands."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from groundstation.recorder import About, Recorder
from tests.groundstation.synthetic import WALL_NS, Story, fleet, messages
from tests.processes.running import BIN, wait_for
from tests.web.browser import Watched, chromium

pytestmark = pytest.mark.process

LENGTH_S = 30.0


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Watched]:
    """The page that `echelon replay` serves."""
    recording, told = tmp_path / "run.mcap", tmp_path / "replay.log"
    with Recorder(recording, fleet(), About(WALL_NS, "lockstep", 1)) as recorder:
        for message in messages(Story(duration_s=LENGTH_S)):
            recorder.write(*message)
    command = (str(BIN / "echelon"), "replay", str(recording), "--port", "0")
    with told.open("wb") as output, chromium() as browser:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        try:
            wait_for(lambda: "http://" in told.read_text() or process.poll() is not None)
            found = re.search(r"http://\S+", told.read_text())
            assert found is not None, told.read_text()
            yield Watched(browser.new_page(), found[0])
        finally:
            process.terminate()
            process.wait(10)


def position_s(page: Watched) -> float:
    minutes, seconds = page.text("#position").split(" / ")[0].split(":")
    return 60.0 * float(minutes) + float(seconds)


def test_a_recording_is_played_sought_and_slowed_from_the_page(page: Watched) -> None:
    locate = page.page.locator
    expect(locate("#player")).to_be_visible()
    expect(locate("#commands")).to_be_hidden()
    expect(locate("#estop")).to_be_hidden()
    expect(locate("#connection")).to_have_text("replay")
    expect(locate("#position")).to_contain_text("0:30.0")
    if page.text("#play") == "Pause":
        locate("#play").click()
    expect(locate("#play")).to_have_text("Play")

    locate("#seek").fill("20")
    expect(locate("#position")).to_have_text(re.compile(r"^0:20\.0 "))
    page.says("#robot-r2 .state", "RUNNING")

    locate("#speed").select_option("10")
    locate("#play").click()
    wait_for(lambda: position_s(page) > 24.0)
    locate("#play").click()
    expect(locate("#play")).to_have_text("Play")
    stopped_s = position_s(page)
    frames = page.number("echelon.frames")
    wait_for(lambda: page.number("echelon.frames") > frames + 5)
    assert position_s(page) == stopped_s

    page.page.keyboard.press(" ")
    expect(locate("#play")).to_have_text("Pause")
    assert (page.errors, page.foreign) == ([], [])
