"""Each: work that several processors share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")
_Made = TypeVar("_Made")


def each(work: Callable[[_Item], _Made], items: Iterable[_Item], jobs: int) -> list[_Made]:
    """What `work` makes of each item, in their order, by up to `jobs` threads.

    Threads do, as numpy lets others run while it computes; none waits for another in the midst of its work, so that a
    busy machine costs no more than its share.
    """
    items = list(items)
    if jobs == 1 or len(items) < 2:
        return [work(item) for item in items]
    with ThreadPoolExecutor(min(jobs, len(items))) as pool:
        return list(pool.map(work, items))
