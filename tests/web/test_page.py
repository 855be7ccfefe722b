"""The page in a real browser, with real processes: what the operator sees and does.

Robots start, are armed and driven from the page, and stopped; what counts is what is on their
CAN buses. Figures are printed.
"""

import select
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import NamedTuple

import can
import pytest
from playwright.sync_api import Browser, ViewportSize

from config.can.database import CanDatabase
from config.fleet import Fleet
from groundstation.endpoints import with_real_port
from groundstation.fleet_link import ANY_LOOPBACK
from tests.processes.running import wait_for
from tests.web.browser import Processes, Watched, chromium, cpu_s, processes
from tests.web.ten_robots import ten_robots

pytestmark = pytest.mark.process

SHOWN_LIMIT_S = 2.0
FRAMES_LIMIT_HZ, CPU_LIMIT = 25.0, 0.10
WINDOWS, WINDOW_S = 5, 2.0
PHONE = ViewportSize(width=390, height=844)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="echelon-") as path:
        yield Path(path)


@pytest.fixture(scope="module")
def fleet(folder: Path) -> Iterator[Processes]:
    with processes(folder) as running:
        yield running


class Station(NamedTuple):
    """A running `echelon monitor` and its page's address."""

    process: subprocess.Popen[bytes]
    url: str


@pytest.fixture(scope="module")
def station(fleet: Processes) -> Station:
    return Station(*fleet.monitor())


def watch(browser: Browser, url: str) -> Watched:
    """A new page in a window of its own."""
    return Watched(browser.new_context(viewport={"width": 1440, "height": 900}).new_page(), url)


class Bus:
    """A listener on one robot's CAN bus that waits for its axes' emergency stop."""

    def __init__(self, fleet: Fleet, name: str) -> None:
        robot = fleet.robots[name]
        vehicle, database = robot.vehicle, CanDatabase.load()
        nodes = (vehicle.steering.node, vehicle.drive.node)
        self.awaited = {database.axis(node).estop.can_id for node in nodes}
        self._bus = can.Bus(interface="simcan", channel=robot.can.channel)

    def missing(self) -> set[int]:
        """Emergency stops that have not been on the bus yet."""
        while self.awaited and (message := self._bus.recv(0)) is not None:
            self.awaited.discard(message.arbitration_id)
        return self.awaited

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()


def measured(seen: Watched, pid: int) -> tuple[float, float]:
    """Frames per second and the process's share of a core over the next window."""
    frames, used_s, begun_s = seen.number("echelon.drawn"), cpu_s(pid), time.monotonic()
    wait_for(lambda: time.monotonic() - begun_s >= WINDOW_S)
    lasted_s = time.monotonic() - begun_s
    return (seen.number("echelon.drawn") - frames) / lasted_s, (cpu_s(pid) - used_s) / lasted_s


def test_ten_robots_are_shown_smoothly_and_cost_little(browser: Browser, folder: Path) -> None:
    endpoint = with_real_port(ANY_LOOPBACK)
    many = folder / "ten"
    many.mkdir()
    with processes(many, ten_robots(endpoint)) as running:
        monitor, url = running.monitor()
        source = (sys.executable, "-m", "tests.web.ten_robots", running.fleet.ground)
        running.start(*source, log="source.log")
        seen = watch(browser, url)
        seen.says("#robot-r10 .state", "RUNNING")
        rates_hz, shares = zip(*(measured(seen, monitor.pid) for _ in range(WINDOWS)), strict=True)
        told = [
            f"{rate:.1f} Hz {100 * share:.1f} %"
            for rate, share in zip(rates_hz, shares, strict=True)
        ]
        print(f"\n10 robots, frames and server's share of a core: {', '.join(told)}")
        assert (seen.errors, seen.foreign) == ([], [])
        seen.page.close()
        assert median(rates_hz) >= FRAMES_LIMIT_HZ
        assert median(shares) <= CPU_LIMIT


def test_drive_and_emergency_stop_from_the_page(
    browser: Browser, fleet: Processes, station: Station
) -> None:
    """Robots appear, are driven with held buttons, change formation, and all stop at one key."""
    seen = watch(browser, station.url)
    seen.says("#connection", "live")
    fleet.hardware()
    started_s = time.monotonic()
    fleet.robots()
    names = list(fleet.fleet.robots)
    wait_for(lambda: all(map(fleet.up, names)))
    up_s = time.monotonic()
    seen.page.wait_for_function(
        "names => names.every(name => !['silent', 'gone'].includes("
        "document.querySelector(`#robot-${name} .state`).innerText))",
        arg=names,
    )
    shown_s = time.monotonic()
    print(
        f"\nall robots on the page {shown_s - up_s:.2f} s after the last was up, "
        f"{shown_s - started_s:.2f} s after the start of their processes"
    )
    assert shown_s - up_s <= SHOWN_LIMIT_S
    seen.says("#readiness", "All 3 robots ready")
    seen.page.locator("#order-arm").click()
    assert seen.text("#answer") == "", "a short click must not command anything"
    seen.hold("#order-arm")
    seen.says("#readiness", "3 armed")
    seen.hold("#order-start")
    seen.says("#readiness", "3 running")
    seen.says("#commander", "you are in command")
    seen.hold("#formation-wide")
    seen.says("#answer", "accepted by all 3 robots")
    buses = [Bus(fleet.fleet, name) for name in names]
    pressed_s = time.monotonic()
    seen.page.locator("#estop").click()
    while missing := [bus for bus in buses if bus.missing()]:
        assert time.monotonic() < pressed_s + 5, "the emergency stop is not on every bus"
        select.select([], [], [], 0.001)
    print(f"click to the last of {2 * len(buses)} axes: {time.monotonic() - pressed_s:.3f} s")
    assert not missing
    for bus in buses:
        bus.close()
    seen.says("#banners", "Confirmed by all robots: r1, r2, r3")
    seen.hold("#order-reset")
    seen.says("#answer", "accepted by all 3 robots")
    seen.page.locator("#give-back").click()
    seen.says("#commander", "nobody in command")
    assert (seen.errors, seen.foreign) == ([], [])
    seen.page.close()


def test_a_second_operator_sees_the_first_and_escape_stops_from_there(
    browser: Browser, station: Station
) -> None:
    first, second = watch(browser, station.url), watch(browser, station.url)
    first.page.locator("#operator-name").fill("Anna")
    first.page.locator("#operator button").click()
    first.hold("#order-arm")
    second.says("#commander", "Anna is in command")
    assert second.page.locator("#order-start").is_disabled()
    assert second.page.locator("#take").is_visible()
    second.page.keyboard.press("Escape")
    first.says("#banners", "EMERGENCY STOP by operator")
    first.says("#banners", "Confirmed by all robots")
    second.hold("#take")
    second.hold("#order-reset")
    second.says("#answer", "accepted by all 3 robots")
    for page in (first, second):
        assert (page.errors, page.foreign) == ([], [])
        page.page.close()


def test_it_fits_a_phone_and_names_every_control(browser: Browser, station: Station) -> None:
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    seen = Watched(context.new_page(), station.url)
    seen.says("#robot-r1 .state", "STANDBY")
    assert seen.number("document.documentElement.scrollWidth") <= PHONE["width"]
    stop = seen.page.locator("#estop").bounding_box()
    assert stop is not None
    assert stop["height"] >= 60
    assert stop["y"] + stop["height"] <= PHONE["height"]
    unnamed = seen.page.evaluate(
        "[...document.querySelectorAll('button, input, select, canvas')]"
        ".filter(each => each.checkVisibility())"
        ".filter(each => !(each.innerText || each.ariaLabel || each.labels?.length))"
        ".map(each => each.id)"
    )
    assert unnamed == []
    small = seen.page.evaluate(
        "[...document.querySelectorAll('#commands button')].filter(b => b.checkVisibility())"
        ".map(b => b.getBoundingClientRect().height).filter(height => height < 40)"
    )
    assert small == [], "too small for a finger"
    context.close()


def test_it_connects_again_after_the_server_was_killed(
    browser: Browser, fleet: Processes, station: Station
) -> None:
    seen = watch(browser, station.url)
    seen.says("#connection", "live")
    station.process.kill()
    station.process.wait()
    seen.says("#connection", "no connection")
    assert "does not reach the robots" in seen.text("#banners")
    port = int(station.url.rstrip("/").rpartition(":")[2])
    restarted_s = time.monotonic()
    fleet.monitor(port)
    up_s = time.monotonic()
    seen.says("#connection", "live")
    print(
        f"\nlive again {time.monotonic() - up_s:.2f} s after the server was up, "
        f"{time.monotonic() - restarted_s:.2f} s after its start"
    )
    seen.says("#robot-r1 .state", "STANDBY")
    refused = [each for each in seen.errors if "ERR_CONNECTION_REFUSED" not in each]
    assert (refused, seen.foreign) == ([], [])
