"""Cost of the C and S of GCS, as ratios of times measured alternately in one run. Run with `pytest benchmarks -n0`.

A batch has parameters for each environment, as in training. "Cold" batches come from memory instead of the processor's
caches, like those of a replay buffer. All run on one thread, except for numpy's matrix products.
"""

import itertools
import math
import warnings

import mujoco
import numpy as np
import pytest
from test_speed import PAPER, median_ratio, squeezed_peg

from paxisim.augment.gcs import GCS
from paxisim.models.readout import TactileReadout

LAYOUT = PAPER.pool(2, 2)
FRAMES = 4096
COPIES = 6  # the target, in multiples of the time to copy the tensor
COLD = 32  # number of batches used in turn, more than the caches hold


def batches(count):
    force = np.random.default_rng(0).normal(size=(count, FRAMES, 2, 3, 6, 5))
    return force.astype(np.float32)


def numpy_chain():
    return GCS().sample(np.random.default_rng(1), (FRAMES,), layout=LAYOUT)


def test_one_frame(compare):
    model, pads, data = squeezed_peg(LAYOUT)
    force = TactileReadout(model, pads).read(data)
    chain = GCS().sample(np.random.default_rng(0), layout=LAYOUT)
    count = 50

    def frames():
        for _ in range(count):
            chain(force)

    times = compare.time(frames, {"steps": lambda: mujoco.mj_step(model, data, count)}, rounds=60)
    compare.report("C and S of one frame / mj_step, two pads of 6x5", median_ratio(times["main"], times["steps"]), 0.3)


@pytest.mark.parametrize("cold", [False, True], ids=["warm", "cold"])
def test_batch_numpy(compare, cold):
    chain, xs = numpy_chain(), itertools.cycle(list(batches(COLD if cold else 1)))
    times = compare.time(lambda: chain(next(xs)), {"copy": lambda: next(xs).copy()}, rounds=100)
    what = f"C and S of {FRAMES} frames / copy, numpy{', cold' if cold else ''}"
    compare.report(what, median_ratio(times["main"], times["copy"]), COPIES)


@pytest.mark.parametrize("cold", [False, True], ids=["warm", "cold"])
@pytest.mark.parametrize("compiled", [False, True], ids=["eager", "compiled"])
def test_batch_torch(compare, compiled, cold):
    torch = pytest.importorskip("torch")
    torch.set_num_threads(1)  # as for numpy; threads that wait for one another on a busy machine distort the timing
    chain = GCS().sample(torch.Generator().manual_seed(1), (FRAMES,), layout=LAYOUT)
    xs = itertools.cycle(list(torch.from_numpy(batches(COLD if cold else 1))))
    apply = chain
    if compiled:
        apply = torch.compile(lambda x: chain(x), fullgraph=True)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # torch's internal warnings
                apply(next(xs))
        except Exception as error:
            pytest.skip(f"torch.compile does not work here; it needs a C++ compiler: {type(error).__name__}")
    times = compare.time(lambda: apply(next(xs)), {"copy": lambda: next(xs).clone()}, rounds=100)
    how = f"torch CPU{' compiled' if compiled else ''}{', cold' if cold else ''}"
    compare.report(f"C and S of {FRAMES} frames / copy, {how}", median_ratio(times["main"], times["copy"]), COPIES)


def loop_over_taxels(force, chain, environment):
    """Compute C and S of one frame in plain Python, on ``(pads, 3, rows, cols)`` nested lists."""
    cx, cy = float(chain["poisson"].cx[environment]), float(chain["poisson"].cy[environment])
    axis, taxel = chain["axis_gain"].gain[environment].tolist(), chain["taxel_gain"].gain[environment].tolist()
    near = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    one_side = 1 + 2 * math.exp(1 - math.sqrt(2)) / math.sqrt(2)
    result = []
    for p, (fx, fy, fz) in enumerate(force):
        out = [[[0.0] * 5 for _ in range(6)] for _ in range(3)]
        for r in range(6):
            for c in range(5):
                shear_x, shear_y = fx[r][c], fy[r][c]
                for i, j in near:
                    if 0 <= r + i < 6 and 0 <= c + j < 5:
                        distance = math.hypot(i, j)
                        push = math.exp(1 - distance) / one_side * fz[r + i][c + j] / distance
                        shear_x -= cx * push * j
                        shear_y -= cy * push * i
                for k, value in enumerate((shear_x, shear_y, fz[r][c])):
                    out[k][r][c] = value * axis[k] * taxel[p][r][c]
        result.append(out)
    return result


def test_batch_against_a_loop(compare):
    chain, force = numpy_chain(), batches(1)[0]
    few = force[:16].tolist()

    def loop():
        return [loop_over_taxels(frame, chain, environment) for environment, frame in enumerate(few)]

    np.testing.assert_allclose(loop(), chain(force)[:16], atol=1e-5)
    times = compare.time(lambda: chain(force), {"loop": loop}, rounds=30)
    ratio = median_ratio(times["main"], times["loop"] * FRAMES / len(few))
    compare.report(f"C and S of {FRAMES} frames, numpy / a Python loop over taxels", ratio, 0.01)
