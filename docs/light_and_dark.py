"""The two variants of a picture of the documentation, for light and for dark pages."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path


def light_and_dark(path: Path) -> Iterator[Path]:
    """Go twice through the body of a loop that draws a picture: as it is, and with matplotlib's dark style.

    Dark pictures are transparent, since pages differ in their dark.

    Args:
        path: The picture, such as ``x.png``.

    Yields:
        `path`, then ``x-dark.png`` beside it.
    """
    from matplotlib import style

    yield path
    ink = dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), "#d9dde2")
    rest = {"grid.color": "#7d8590", "legend.facecolor": "none", "savefig.transparent": True}
    with style.context(["dark_background", {**ink, **rest}]):
        yield path.with_stem(f"{path.stem}-dark")
