"""What all tests share."""

import os
import sys

# before numpy is imported: the threads of several test processes would wait for one another
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import pytest  # noqa: E402


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Try again what a stalled machine may fail, and leave out what needs robosuite where it cannot be installed."""
    for item in items:
        if item.get_closest_marker("real_time"):
            # a machine that stands still for a second looks to a driver as a sensor that is silent
            item.add_marker(pytest.mark.flaky(reruns=2))
    if sys.version_info >= (3, 13):
        reason = "robosuite 1.5.2 needs numpy < 2, which has no wheels for Python 3.13"
        for item in items:
            if item.get_closest_marker("robosuite"):
                item.add_marker(pytest.mark.skip(reason=reason))
