"""Draws docs/images/report.png: the page that a diagnosis writes, as a browser shows it.

The recording of `paxisim example recording` is diagnosed, and its report.html is opened in a headless Chromium, in a
window narrow enough that its text can be read in a page. The picture is the head of the page.

    python docs/report_picture.py
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from light_and_dark import light_and_dark
from PIL import Image

import paxisim
from paxisim.cli.example import example_recording
from paxisim.viz.drawing import on_dark

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from browser import Browser, Page, find

WIDTH, SCALE = 640, 2  # pixels of the page, and of the picture for each of them
OUTPUT = Path(__file__).parent / "images" / "report.png"


def main() -> None:
    """Diagnose, open the page, save the picture."""
    found = paxisim.diagnose(example_recording())
    print(found)
    chrome = find()
    if chrome is None:
        raise SystemExit("there is no Chromium; set CHROME to its path")
    with tempfile.TemporaryDirectory() as folder, Browser(chrome) as browser:
        found.save(folder)
        for path in light_and_dark(OUTPUT):
            save(browser.open(Path(folder) / "report.html", WIDTH, dark=on_dark()), path)


def save(page: Page, path: Path) -> None:
    """Save the page down to its first heading after the title."""
    shown = Image.open(io.BytesIO(page.screenshot(SCALE))).convert("RGB")
    end = int(page.value("document.querySelector('main h2').getBoundingClientRect().top")) - 16
    head = shown.crop((0, 0, shown.width, SCALE * end))
    few = head.quantize(64, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
    few.save(path, optimize=True)
    print(f"{path}: {few.size}, {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
