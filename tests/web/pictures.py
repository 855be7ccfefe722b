"""Takes the pictures of the page for the documentation: `make pictures`.

Real processes drive the demo fleet; the page is shown light, dark and on a phone.
"""

import tempfile
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, ViewportSize

from tests.web.browser import Processes, Watched, chromium, processes

FOLDER = Path("docs/images")
DESK, PHONE = ViewportSize(width=1440, height=900), ViewportSize(width=390, height=844)
DRIVEN_S = 13.0


def main() -> None:
    """Drive, and look."""
    with (
        tempfile.TemporaryDirectory(prefix="echelon-") as folder,
        chromium() as browser,
        processes(Path(folder)) as fleet,
    ):
        _, url = fleet.monitor()
        fleet.hardware()
        fleet.robots()
        operator = _page(browser, url, "light", DESK)
        operator.page.evaluate("localStorage.setItem('echelon.operator', 'Anna')")
        operator.page.reload()
        dark = _page(browser, url, "dark", DESK)
        dark.page.locator("#layer-truth").click()
        phone = _page(browser, url, "light", PHONE)
        operator.says("#readiness", "All 3 robots ready")
        operator.hold("#order-arm")
        operator.says("#readiness", "3 armed")
        operator.hold("#order-start")
        operator.says("#mission", f"{DRIVEN_S:.0f}.")
        _save(operator, "page-light.png")
        _save(dark, "page-dark.png")
        phone.page.screenshot(path=FOLDER / "page-phone.png")
        _stopped(operator, fleet)


def _stopped(operator: Watched, fleet: Processes) -> None:
    operator.page.keyboard.press("Escape")
    operator.says("#banners", "Confirmed by all robots")
    _settle(operator)
    operator.page.screenshot(path=FOLDER / "page-estop.png")


def _page(
    browser: Browser, url: str, scheme: Literal["light", "dark"], size: ViewportSize
) -> Watched:
    scale = 2 if size is PHONE else 1
    context = browser.new_context(viewport=size, color_scheme=scheme, device_scale_factor=scale)
    return Watched(context.new_page(), url)


def _settle(seen: Watched) -> None:
    """Let the page draw for about a second."""
    drawn = seen.number("echelon.drawn")
    seen.page.wait_for_function("drawn => echelon.drawn > drawn + 30", arg=drawn)


def _save(seen: Watched, name: str) -> None:
    seen.page.screenshot(path=FOLDER / name, full_page=True)


if __name__ == "__main__":
    main()
