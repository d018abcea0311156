"""A browser for the tests of pages: Chromium without a screen and without a GPU."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

ARGUMENTS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
]


@contextmanager
def browser() -> Iterator[Browser]:
    """Chromium of the system; pip would fetch another one."""
    program = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )
    if program is None:
        pytest.skip("pages in a browser not tested: no chromium (apt-get install chromium)")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=program, args=ARGUMENTS)
        yield opened
        opened.close()


class Shown:
    """A page that is open: its picture, and what went wrong."""

    def __init__(self, opened: Browser, file: Path) -> None:
        self.wrong: list[str] = []
        self.page: Page = opened.new_page(viewport={"width": 1100, "height": 700})
        self.page.on("console", lambda message: self.wrong.append(message.text))
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.wrong.append(request.url))
        self.page.goto(file.as_uri())
        self.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
        # The page itself is the only request.
        assert self.wrong == [file.as_uri()]
        self.wrong.clear()

    @property
    def seconds(self) -> float:
        """Time from the start of loading to the first picture."""
        return float(self.page.evaluate("document.documentElement.dataset.drawn"))

    def picture(self) -> bytes:
        """The canvas as it is drawn now, as a PNG."""
        self.page.wait_for_timeout(200)
        return self.page.locator("#picture").screenshot()

    def changes(self, selector: str, value: float | bool) -> bool:
        """Set a slider, or a box that is ticked; whether the picture changes."""
        before = self.picture()
        control = self.page.locator(selector)
        if isinstance(value, bool):
            control.set_checked(value)
        else:
            control.fill(str(value))
        return self.picture() != before

    def under(self, x: float, y: float) -> tuple[int, list[str]]:
        """Number and text of what lies at a place of the picture, in fractions of its size."""
        box = self.page.locator("#picture").bounding_box()
        assert box is not None
        self.page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"])
        self.page.wait_for_timeout(200)
        under = self.page.locator("#under")
        if not under.is_visible():
            return -1, []
        return int(str(under.get_attribute("data-index"))), under.inner_text().splitlines()
