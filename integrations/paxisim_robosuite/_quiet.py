"""Import of robosuite without its warnings about optional parts, which do not matter here."""

import contextlib
import logging
from collections.abc import Iterator


@contextlib.contextmanager
def quietly() -> Iterator[None]:
    """Log only errors within the context."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(before)


with quietly():
    import robosuite as robosuite
