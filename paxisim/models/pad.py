"""Pad: one sensor pad as MJCF, a grid of contiguous taxel cubes on a base without contacts.

The pad's body frame is the pad frame of `paxisim.layout`: the flat sensing surface is the plane z = 0, the cubes reach
from there to z = thickness, and the base lies behind them. Objects touch the pad from -z.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.models import names, touch_grid
from paxisim.models.gel import CONTACTS, Gel
from paxisim.models.mjcf import numbers
from paxisim.models.surface import check_heights

DENSITY = 1200.0
"""Density (kg/m^3) behind the default mass: between silicone (1100) and a thin circuit board (1850)."""

MAX_TAXELS = 40_000
"""Largest number of taxels of a pad. MuJoCo's compile time grows with its square: 10,000 take ten seconds, this many
minutes."""
LENGTHS = (1e-5, 1.0)
"""Smallest and largest pitch, thickness and base (m); values outside suggest a wrong unit."""

_GROUP = "1"  # visible in MuJoCo's viewer and in robosuite's renderers, which hide collision group 0


@dataclass(frozen=True, eq=False)
class Pad:
    """Description of one pad.

    Attributes:
        layout: Layout of the taxels.
        name: Name of the pad and of its body; prefix of all other names in its MJCF.
        thickness: Nominal thickness of the taxel cubes (m); 1 mm in the paper (Method).
        heights: ``(rows, cols)`` thickness of each cube (m), from `paxisim.models.surface`; default: flat, with
            `thickness`. A cube keeps its back and grows towards the object.
        gel: Compliance of the surface.
        base: Thickness (m) of the base drawn behind a flat pad; it has mass but touches nothing.
        mass: Mass of the pad (kg); default: that of cubes and base with `DENSITY`.
        sensors: MuJoCo sensors to embed: ``"contact"`` (one contact sensor per taxel, which GPU ports of MuJoCo
            support), ``"touch_grid"`` (the plugin used in the paper; leaves gaps of 50 um between the cubes, see
            `paxisim.models.touch_grid`) or none. `TactileReadout` needs none.
        contype: Contact type bits of the taxels.
        conaffinity: Contact affinity bits of the taxels. With the defaults, taxels collide with every ordinary geom
            but not with other pads, whose contacts would be slow and meaningless.
        taxels: Geoms that carry the contacts: ``"boxes"``, the paper's contiguous cubes, or ``"spheres"``, one per
            taxel with diameter `thickness`. A sphere senses the indentation at its middle, a box that at its deepest
            corner. A box is four times softer if an object makes one contact with it instead of four, as round objects
            do (`benchmarks/taxel_shapes.py`). The indentation of spheres must not exceed their radius.

    Raises:
        InvalidValueError: The name is empty or XML cannot hold it, there are more than `MAX_TAXELS` taxels, a value is
            not finite, the mass is not positive, a length is outside `LENGTHS`, the heights have the wrong shape, pads
            with these contact bits would collide with each other, or the kind of taxels or sensors is unknown.
    """

    layout: TaxelLayout
    name: str = "pad"
    thickness: float = 1e-3
    heights: NDArray[np.floating] | None = None
    gel: Gel = field(default_factory=Gel)
    base: float = 2e-3
    mass: float | None = None
    sensors: Literal["contact", "touch_grid"] | None = None
    contype: int = 0
    conaffinity: int = 1
    taxels: Literal["boxes", "spheres"] = "boxes"

    def __post_init__(self) -> None:
        """Check the values."""
        if not self.name:
            raise InvalidValueError("a pad must have a name, by which find_pads finds it")
        names.check("a pad's name", self.name)
        if self.layout.taxels > MAX_TAXELS:
            raise InvalidValueError(f"a pad has at most {MAX_TAXELS} taxels, got {self.layout.rows}x{self.layout.cols}")
        for what in ("thickness", "base", "mass"):
            value = getattr(self, what)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InvalidValueError(f"a pad's {what} must be positive and finite, got {value!r}")
        low, high = LENGTHS
        lengths = {"pitch": self.layout.pitch, "thickness": (self.thickness,), "base": (self.base,)}
        for what, values in lengths.items():
            if not all(low <= value <= high for value in values):
                got = ", ".join(f"{value:g}" for value in values)
                raise InvalidValueError(f"a pad's {what} must lie between {low:g} and {high:g} m, got {got}")
        if self.heights is not None:
            heights = check_heights(self.heights, self.layout)
            if heights.ndim != 2:
                shape = (self.layout.rows, self.layout.cols)
                raise InvalidValueError(f"a pad's heights must have shape {shape}, got {heights.shape}")
            object.__setattr__(self, "heights", heights)
        if self.contype & self.conaffinity:
            raise InvalidValueError(
                f"contype {self.contype} and conaffinity {self.conaffinity} share bits: pads would meet each other"
            )
        if self.sensors not in (None, "contact", "touch_grid"):
            raise InvalidValueError(f"sensors must be 'contact', 'touch_grid' or None, got {self.sensors!r}")
        if self.taxels not in ("boxes", "spheres"):
            raise InvalidValueError(f"taxels must be 'boxes' or 'spheres', got {self.taxels!r}")
        if self.sensors == "touch_grid":
            if self.taxels != "boxes":
                raise InvalidValueError("touch_grid distinguishes taxels by their boxes: use taxels='boxes'")
            touch_grid.check_layout(self.layout)

    def to_xml(self) -> str:
        """Return the pad as a complete MJCF document; the same pad always gives the same bytes."""
        root = etree.Element("mujoco", model=self.name)
        if self.sensors == "touch_grid":
            touch_grid.add_extension(root)
        self._add_body(etree.SubElement(root, "worldbody"))
        if self.sensors is not None:
            self._add_sensors(etree.SubElement(root, "sensor"))
        return etree.tostring(root, pretty_print=True, encoding="unicode")

    def _add_body(self, world: etree._Element) -> None:
        layout = self.layout
        body = etree.SubElement(world, "body", name=self.name)
        self._add_inertial(body)
        low, high = _bounds(layout)
        centre, half = (low + high) / 2, (high - low) / 2
        gel_centre, gel_half = centre + [0, 0, self.thickness / 2], half + [0, 0, self.thickness / 2]
        site = {"type": "box", "pos": numbers(gel_centre), "size": numbers([*gel_half[:2], self.thickness / 2])}
        etree.SubElement(body, "site", {"name": names.gel(self.name), "group": "4", "rgba": "0 0 0 0", **site})
        if self.sensors == "touch_grid":
            touch_grid.add_site(body, self.name, layout)
        # the mass of the base counts only in models with inertiafromgeom
        mass = numbers([self._mass()])
        if layout.is_grid:
            behind = centre + [0, 0, self.thickness + self.base / 2]
            size = [*half[:2], self.base / 2]
            self._add_geom(body, names.base(self.name), "box", behind, size, mass=mass, rgba="0.2 0.2 0.22 1")
        else:
            around = centre + [0, 0, (self.thickness + self.base) / 2]
            self._add_geom(
                body, names.base(self.name), "box", around, self._extent() / 2, mass=mass, rgba="0 0 0 0", group="4"
            )
        solref, solimp = self.gel.file_parameters(layout, CONTACTS[self.taxels])
        touched = {
            "contype": str(self.contype),
            "conaffinity": str(self.conaffinity),
            "condim": "3",
            "priority": "1",
            "friction": numbers([self.gel.friction, 0.005, 0.0001]),
            "solref": numbers(solref),
            "solimp": numbers(solimp),
        }
        positions, halves, quats = cubes(layout, self.thickness, self.heights)
        kind = "box" if self.taxels == "boxes" else "sphere"
        halves = halves if kind == "box" else halves[:, 2:]
        if self.sensors == "touch_grid":
            halves[:, :2] -= touch_grid.CUBE_GAP / 2
        order = None if layout.vendor_order is None else np.argsort(layout.vendor_order)
        for index in range(layout.taxels):
            row, col = divmod(index, layout.cols)
            if order is not None:  # read again by find_pads; 0 is MuJoCo's default
                touched["user"] = str(1 + order[index])
            if not layout.is_grid:
                touched["quat"] = numbers(quats[index])
            # two shades, so that the taxels can be told apart
            rgba = "0.75 0.75 0.75 1" if (row + col) % 2 else "0.85 0.85 0.85 1"
            name = names.taxel(self.name, row, col)
            self._add_geom(body, name, kind, positions[index], halves[index], rgba=rgba, **touched)

    def _extent(self) -> NDArray[np.floating]:
        low, high = _bounds(self.layout)
        return high - low + [0, 0, self.thickness + self.base]

    def _mass(self) -> float:
        return self.mass if self.mass is not None else DENSITY * float(np.prod(self._extent()))

    def _add_inertial(self, body: etree._Element) -> None:
        # explicit, so that neither the surface nor the visible base changes the gripper's dynamics
        low, high = _bounds(self.layout)
        extent = self._extent()
        mass = self._mass()
        squares = extent**2
        inertia = mass / 12 * (squares.sum() - squares)
        centre = (low + high) / 2 + [0, 0, (self.thickness + self.base) / 2]
        etree.SubElement(body, "inertial", pos=numbers(centre), mass=numbers([mass]), diaginertia=numbers(inertia))

    def _add_geom(self, body: etree._Element, name: str, kind: str, pos, size, **attributes: str) -> None:
        shape = {"type": kind, "pos": numbers(pos), "size": numbers(size), "mass": "0", "group": _GROUP}
        bits = {"contype": "0", "conaffinity": "0"}
        etree.SubElement(body, "geom", {"name": name, **shape, **bits, **attributes})

    def _add_sensors(self, parent: etree._Element) -> None:
        if self.sensors == "touch_grid":
            touch_grid.add_sensor(parent, self.name, self.layout)
            return
        for index in range(self.layout.taxels):
            row, col = divmod(index, self.layout.cols)
            etree.SubElement(
                parent,
                "contact",
                name=names.force(self.name, row, col),
                geom1=names.taxel(self.name, row, col),
                data="force",
                reduce="netforce",
            )


def cubes(
    layout: TaxelLayout, thickness: float, heights: NDArray[np.floating] | None = None
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Return centres, half sizes and orientations of the taxel cubes in the pad frame.

    Args:
        layout: Layout of the taxels.
        thickness: Nominal thickness (m), the depth of the cubes' backs below the sensing surface.
        heights: ``(rows, cols)`` thickness of each cube (m); default: `thickness`.

    Returns:
        Centres ``(N, 3)`` (m), half sizes ``(N, 3)`` (m) and quaternions ``(N, 4)`` (w, x, y, z).
    """
    from scipy.spatial.transform import Rotation

    height = np.full(layout.taxels, thickness) if heights is None else heights.reshape(-1)
    frames = layout.frames
    inward = frames[:, :, 2]
    centres = layout.positions + inward * (thickness - height / 2)[:, None]
    footprint = _footprints(layout)
    halves = np.column_stack([footprint[:, 1] / 2, footprint[:, 0] / 2, height / 2])
    quats = Rotation.from_matrix(frames).as_quat()[:, [3, 0, 1, 2]]
    return centres, halves, quats


def _footprints(layout: TaxelLayout) -> NDArray[np.floating]:
    """Return the footprint of each cube (m), ``(N, 2)``, along its y and along its x.

    On a curved surface, neighbours of a grid are further apart than the pitch. The cubes then grow to stay contiguous,
    because an object that catches in a gap causes large spurious shear.
    """
    footprint = np.tile(layout.pitch, (layout.taxels, 1))
    if layout.is_grid or 1 in (layout.rows, layout.cols):
        return footprint
    grid = layout.positions.reshape(layout.rows, layout.cols, 3)
    for axis in (0, 1):
        gap = np.linalg.norm(np.diff(grid, axis=axis), axis=-1)
        ends = [(1, 1) if a == axis else (0, 0) for a in (0, 1)]
        padded = np.pad(gap, ends, mode="edge")
        either = np.maximum(np.delete(padded, 0, axis), np.delete(padded, -1, axis))
        footprint[:, axis] = np.maximum(footprint[:, axis], either.reshape(-1))
    return footprint


def _bounds(layout: TaxelLayout) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the lower and upper corner of the box around the sensing surface (m, pad frame)."""
    margin = np.array([layout.pitch[1] / 2, layout.pitch[0] / 2, 0])
    return layout.positions.min(axis=0) - margin, layout.positions.max(axis=0) + margin
