"""How far MuJoCo Warp's readings are from those of MuJoCo's own engine, beside how far that engine is from itself.

A peg is held between two pads, each world with bumps and a load (up to 10 N) of its own, 200 steps from the first
contact. "Moved" is MuJoCo's own engine with the peg moved by 1e-7 m. Needs the extra warp:

    python benchmarks/warp_agreement.py
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "warp"))

from held import LAYOUT, differences, held

from paxisim.layout import TaxelLayout

SIX_BY_FIVE = TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
SCENES = {
    "box that slides, 4x3": {"peg": "box", "free": False},
    "box that slides, 6x5": {"peg": "box", "free": False, "layout": SIX_BY_FIVE},
    "box, 4x3": {"peg": "box"},
    "box, 6x5": {"peg": "box", "layout": SIX_BY_FIVE},
    "mesh, 4x3": {"peg": "mesh"},
    "sphere, 4x3": {"peg": "sphere"},
    "cylinder, 4x3": {"peg": "cylinder"},
    "cylinder on spheres, 4x3": {"peg": "cylinder", "taxels": "spheres"},
}


def main(worlds: int = 64, steps: int = 200) -> None:
    import mujoco
    import mujoco_warp
    import warp

    warp.config.log_level = warp.LOG_WARNING
    print(f"mujoco {mujoco.__version__}, mujoco-warp {mujoco_warp.__version__}, warp-lang {warp.__version__}, CPU")
    print(
        f"{worlds} worlds of {steps} steps, largest difference of a taxel (N): median, 99 %, worst, share above 1e-4 N"
    )
    print("| scene | cone | MuJoCo Warp | moved |")
    for name, scene in SCENES.items():
        for cone in ("elliptic", "pyramidal"):
            found = differences(held(cone=cone, **{"layout": LAYOUT, **scene}), worlds, steps)
            figures = [[*np.quantile(each, (0.5, 0.99)), each.max(), np.mean(each > 1e-4)] for each in found]
            cells = " | ".join("{:.1e}, {:.1e}, {:.1e}, {:.2%}".format(*each) for each in figures)
            print(f"| {name} | {cone} | {cells} |", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
