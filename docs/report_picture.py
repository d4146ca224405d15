"""Draws docs/images/report.png: the page that a diagnosis writes, as a browser shows it.

A recording in which a delay and uneven taxels are hidden (tests/hidden) is diagnosed, all causes being looked for, and
its report.html is opened in a headless Chromium; the upper and the lower half of the page stand side by side.

    python docs/report_picture.py
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from PIL import Image

import paxisim
from paxisim.viz.dark import light_and_dark, on_dark

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from browser import Browser, Page, find
from hidden.cases import make

CAUSES, SEED, STRENGTH = ("latency", "taxel_gain"), 6, 0.7
WIDTH, GAP = 1120, 24  # pixels
OUTPUT = Path(__file__).parent / "images" / "report.png"


def main() -> None:
    """Diagnose, open the page, save the picture."""
    case = make(CAUSES, seed=SEED, strength=STRENGTH)
    layout = paxisim.TaxelLayout(*case.measured.shape[-2:], case.pitch)
    recording = paxisim.Recording(
        case.time, case.measured, case.simulated, case.covariates, case.episode, layout, ("left", "right")
    )
    found = paxisim.diagnose(recording)
    print(found)
    chrome = find()
    if chrome is None:
        raise SystemExit("there is no Chromium; set CHROME to its path")
    with tempfile.TemporaryDirectory() as folder, Browser(chrome) as browser:
        found.save(folder)
        for path in light_and_dark(OUTPUT):
            save(browser.open(Path(folder) / "report.html", WIDTH, dark=on_dark()), path)


def save(page: Page, path: Path) -> None:
    """Save the two halves of a page side by side."""
    shown = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    third = "document.querySelector('main').querySelectorAll('h2')[2]"
    middle = int(page.value(f"{third}.getBoundingClientRect().top")) - 24
    height = max(middle, shown.height - middle)
    both = Image.new("RGB", (2 * WIDTH + GAP, height), shown.getpixel((0, 0)))
    both.paste(shown.crop((0, 0, WIDTH, middle)), (0, 0))
    both.paste(shown.crop((0, middle, WIDTH, shown.height)), (WIDTH + GAP, 0))
    both = both.resize((both.width * 2 // 3, both.height * 2 // 3), Image.Resampling.LANCZOS)
    few = both.quantize(128, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
    few.save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
