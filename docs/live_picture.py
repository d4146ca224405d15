"""Draws docs/images/live.png: the live view of a recording, in Rerun's web viewer.

The recording of `paxisim example recording` ends at its strongest moment. A headless Chromium renders the viewer in
software, so this takes a minute.

    python docs/live_picture.py
"""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from urllib.parse import quote

import numpy as np
from PIL import Image

from paxisim.cli import main as paxisim
from paxisim.cli.example import example_recording

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import browser

OUTPUT = Path(__file__).parent / "images" / "live.png"
PAGE, DATA = 9190, 9877  # ports
WAIT = 40  # s until the viewer has drawn
WIDTH, BAR = 1280, 28  # pixels: of the page, and its head, which names the rasterizer
IN_SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


def main() -> None:
    """Write the recording, serve it, save the picture."""
    recording = example_recording()
    strongest = int(np.argmax(recording.measured[:, :, 2].sum(axis=(1, 2, 3))))
    chrome = browser.find()
    if chrome is None:
        raise SystemExit("there is no Chromium; set CHROME to its path")
    browser.FLAGS = (*(flag for flag in browser.FLAGS if flag != "--disable-gpu"), *IN_SOFTWARE)
    with tempfile.TemporaryDirectory() as folder:
        file, drawn = Path(folder) / "press.mcap", Path(folder) / "press.rrd"
        recording[: strongest + 1].save(file)
        paxisim(["live", str(file), "--save", str(drawn)])
        ports = ["--web-viewer-port", str(PAGE), "--port", str(DATA)]
        server = subprocess.Popen([str(Path(sys.executable).with_name("rerun")), str(drawn), "--serve-web", *ports], start_new_session=True)
        try:
            time.sleep(5)
            with browser.Browser(chrome) as window:
                page = window.open(f"http://localhost:{PAGE}?url={quote(f'rerun+http://localhost:{DATA}/proxy', '')}", WIDTH)
                time.sleep(WAIT)
                shown = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        finally:
            os.killpg(server.pid, signal.SIGTERM)  # the command is a wrapper of the viewer
    few = shown.crop((0, BAR, *shown.size)).quantize(128, kmeans=2, dither=Image.Dither.NONE)
    few.save(OUTPUT, optimize=True)
    print(f"{OUTPUT}: {few.size}, {OUTPUT.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
