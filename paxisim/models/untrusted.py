"""untrusted: checks of an MJCF text that came with somebody's file, before MuJoCo compiles it.

MuJoCo opens every file that an MJCF names, and a few words of it can ask for any amount of memory or time.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from lxml import etree

from paxisim.errors import InvalidValueError

MAX_BYTES = 16 << 20
"""Largest MJCF text, in bytes."""
MAX_ELEMENTS = 20_000
"""Most geoms, bodies and other elements, with those that ``replicate``, ``composite`` and ``flexcomp`` make."""
MAX_CELLS = 1 << 22
"""Most cells of a height field and most texels of a texture."""
MIN_TIMESTEP = 5e-5
"""Shortest time step (s)."""
_SIZE = re.compile(r"\d{7,}|\d*\.?\d*e\+?\d{1,3}|\d+[GTPE]", re.IGNORECASE)  # sizes and iterations beyond usual ones
_OPENS = ("include", "model")  # elements that name other models


def check_untrusted(mjcf: object, what: str) -> str:
    """Check that an MJCF is text that names no file and asks for a usual amount of memory and time; return it.

    Args:
        mjcf: What is said to be an MJCF.
        what: Description of its source, for messages.

    Raises:
        InvalidValueError: It is not.
    """
    trust = "; if you trust it, pass trusted=True"
    if not isinstance(mjcf, str) or not mjcf.lstrip().startswith("<"):
        raise InvalidValueError(f"the scene in {what} must be the text of an MJCF, got {mjcf!r:.60}")
    if len(mjcf.encode(errors="replace")) > MAX_BYTES:
        raise InvalidValueError(f"the MJCF in {what} has more than {MAX_BYTES} bytes{trust}")
    try:
        parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
        root = etree.fromstring(mjcf.encode(), parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise InvalidValueError(f"the scene in {what} is not the text of an MJCF: {error}") from error
    if root.tag != "mujoco":
        raise InvalidValueError(f"the scene in {what} must be an MJCF, got <{root.tag}>")
    for element in root.iter(etree.Element):
        named = next((name for name in element.attrib if str(name).startswith("file") and element.get(name)), None)
        if named is not None or element.tag in _OPENS:
            raise InvalidValueError(
                f"the MJCF in {what} names the file {element.get(named or 'file', '')!r} in <{element.tag}>, and "
                f"MuJoCo would open it{trust}"
            )
        if element.tag in ("hfield", "texture"):
            cells = math.prod(_numbers(element, ("nrow", "ncol") if element.tag == "hfield" else ("width", "height")))
            if cells > MAX_CELLS:
                raise InvalidValueError(f"the MJCF in {what} has a <{element.tag}> of {cells:.3g} cells{trust}")
        for name, value in element.attrib.items():
            is_size = element.tag == "size" or (element.tag == "option" and "iterations" in str(name))
            if is_size and _SIZE.fullmatch(str(value).strip()):
                raise InvalidValueError(f"the MJCF in {what} asks for {name}={value!r}{trust}")
        if element.tag == "option" and any(not step >= MIN_TIMESTEP for step in _numbers(element, ("timestep",))):
            raise InvalidValueError(
                f"the MJCF in {what} has a time step of {element.get('timestep')} s, below {MIN_TIMESTEP:g} s{trust}"
            )
    most = _expanded(root)
    if most > MAX_ELEMENTS:
        raise InvalidValueError(f"the MJCF in {what} makes {most:.3g} elements, more than {MAX_ELEMENTS}{trust}")
    return mjcf


def _expanded(root: etree._Element) -> float:
    """Return the number of elements with those that some make by repetition."""
    total, open_ = 0.0, [(root, 1.0)]
    while open_:
        element, times = open_.pop()
        if element.tag in ("replicate", "composite", "flexcomp"):
            times *= max(math.prod(_numbers(element, ("count",))), 1.0)
        total += times
        open_ += [(child, times) for child in element.iterchildren(etree.Element)]
    return total


def _numbers(element: etree._Element, names: tuple[str, ...]) -> Iterator[float]:
    for name in names:
        for word in element.get(name, "").split():
            try:
                yield float(word)
            except ValueError:
                yield math.nan  # MuJoCo refuses it
