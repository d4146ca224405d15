"""Draws docs/images/demo.png: the picture of `paxisim demo`.

python docs/demo_figure.py
"""

from __future__ import annotations

from pathlib import Path

from light_and_dark import light_and_dark

from paxisim.cli.demo import demo

OUTPUT = Path(__file__).parent / "images" / "demo.png"

if __name__ == "__main__":
    for path in light_and_dark(OUTPUT):
        demo(output=path, force=True)
