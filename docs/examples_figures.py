"""Draws docs/images/examples: the pictures that the examples make, as they make them.

python docs/examples_figures.py
"""

from __future__ import annotations

import os
import runpy
import tempfile
from pathlib import Path

from PIL import Image

EXAMPLES = Path(__file__).parents[1] / "examples"
OUTPUT = Path(__file__).parent / "images" / "examples"
MADE = {
    "hello_pad.py": "hello_pad.png",
    "custom_gripper.py": "custom_gripper.png",
    "calibrate_field_sensor.py": "calibration.png",
}
WIDTH = 1400  # most pixels


def main() -> None:
    """Run the examples in a folder that is thrown away, and keep their pictures."""
    OUTPUT.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for example, made in MADE.items():
            runpy.run_path(os.fspath(EXAMPLES / example), run_name="__main__")
            picture = Image.open(made).convert("RGB")
            picture.thumbnail((WIDTH, WIDTH))
            few = picture.quantize(128, method=Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
            path = OUTPUT / Path(example).with_suffix(".png").name
            few.save(path, optimize=True)
            print(f"{path}: {few.size}, {path.stat().st_size / 1e3:.0f} kB")
        os.chdir(EXAMPLES)


if __name__ == "__main__":
    main()
