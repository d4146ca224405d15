"""A parallel map over threads."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")
_Made = TypeVar("_Made")


def parallel_map(work: Callable[[_Item], _Made], items: Iterable[_Item], jobs: int) -> list[_Made]:
    """Return the result of `work` for each item, in order, using up to `jobs` threads.

    Threads are sufficient because numpy releases the global interpreter lock while it computes. Items do not wait for
    each other, so a busy machine slows them down at most proportionally.
    """
    items = list(items)
    if jobs == 1 or len(items) < 2:
        return [work(item) for item in items]
    with ThreadPoolExecutor(min(jobs, len(items))) as pool:
        return list(pool.map(work, items))
