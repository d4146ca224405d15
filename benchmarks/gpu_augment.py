"""Cost of the C and S of GCS on a GPU, relative to a copy of the tensor on the device. Skipped without CUDA.

65,536 frames of two 6x5 pads, each with its own parameters. Timed with CUDA events after a warm-up; median of 100.

    python benchmarks/gpu_augment.py
"""

from __future__ import annotations

import statistics
from collections.abc import Callable

from paxisim.augment.gcs import GCS

FRAMES = 65_536
TARGET = 3.0  # in multiples of the time of a copy


def milliseconds(work: Callable[[], object], rounds: int = 100) -> float:
    """Return the median time on the device."""
    import torch

    for _ in range(10):
        work()
    events = [[torch.cuda.Event(enable_timing=True) for _ in range(2)] for _ in range(rounds)]
    for start, end in events:
        start.record()
        work()
        end.record()
    torch.cuda.synchronize()
    return statistics.median(start.elapsed_time(end) for start, end in events)


def main() -> None:
    """Measure and print."""
    try:
        import torch
    except ImportError:
        print("skipped: torch is not installed")
        return
    if not torch.cuda.is_available():
        print("skipped: no CUDA device was found")
        return
    device = torch.device("cuda", torch.cuda.current_device())
    chain = GCS().sample(device, (FRAMES,))
    force = torch.randn(FRAMES, 2, 3, 6, 5, device=device)
    out = torch.empty_like(force)
    compiled = torch.compile(lambda x: chain(x), fullgraph=True)
    expected = chain(force[:]).double()
    error = float((compiled(force) - expected).abs().max())
    copy = milliseconds(lambda: out.copy_(force))
    print(f"{torch.cuda.get_device_name(device)}, torch {torch.__version__}; {FRAMES} frames, copy {copy:.4f} ms")
    for name, work in {"eager": chain, "compiled": compiled}.items():
        ratio = milliseconds(lambda work=work: work(force)) / copy
        print(f"C and S / copy, {name:9} {ratio:6.2f}   target {TARGET:g}: {'met' if ratio <= TARGET else 'NOT MET'}")
    # check that parameters are drawn on the device and that nothing synchronises with it
    torch.cuda.set_sync_debug_mode("error")
    GCS().sample(device, (FRAMES,))(force)
    torch.cuda.set_sync_debug_mode("default")
    print(f"largest difference between compiled and eager: {error:.1e} N; sampling and applying do not synchronise")


if __name__ == "__main__":
    main()
