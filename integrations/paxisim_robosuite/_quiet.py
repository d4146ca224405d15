"""Robosuite, imported without its warnings of optional parts of its own, which are nobody's business here."""

import contextlib
import logging
from collections.abc import Iterator


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Log nothing but errors for a while."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(before)


with quietly():
    import robosuite as robosuite
