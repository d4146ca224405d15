"""PosedRobot: pictures of a robot with pads in one pose: all of it, its hands, and single pads."""

from __future__ import annotations

import itertools
import textwrap
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.models.pads import Pads
from paxisim.viz.raster import Picture, render

ASIDE = 0.6
"""Width of a close-up from the side over that of the one from the front."""

_RED = np.array([0.85, 0.2, 0.18])
_INK = np.array([0.1, 0.12, 0.2])
_SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_CUBE = np.array(list(itertools.product((-1, 1), repeat=3)))
_CIRCLE = np.stack([np.cos(np.linspace(0, 2 * np.pi, 16)), np.sin(np.linspace(0, 2 * np.pi, 16))], axis=1)

_PIXELS = 360  # width and height of each picture
_TITLE = 26  # letters in a line of a title
_HAND = 0.25  # m: pads nearer than this belong to one hand
_AROUND = 0.04  # m: what a picture of a hand shows around its pads
_SMALL = 1.5  # a robot this many times larger than its hands gets a picture of its own
_SEEN = 0.35  # cosine between the view and the normal of a pad that is just seen well
_WIDE = 1.2  # half the width of a close-up over the pad's longest side
_BESIDE = 2e-3  # m: what the close-up from the side shows in front of the pad
_THROUGH = 0.6  # opacity of a pad in front of its finger
_LABEL = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.7}
_COVER = 1e-3  # m: a taxel this far behind what is drawn is hidden


class PosedRobot:
    """A robot with pads in one pose, with a method for each kind of picture."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, pads: Pads, triangles: NDArray[np.float64]) -> None:
        """Prepare the pictures.

        Args:
            model: Compiled model.
            data: Its data, with the kinematics computed.
            pads: Its pads.
            triangles: What is drawn beside the pads, from `paxisim.viz.raster.triangles_of`.
        """
        self.model, self.data, self.pads, self.triangles = model, data, pads, triangles
        self.axes = data.xmat[pads.bodies].reshape(-1, 3, 3)
        self.middle = data.geom_xpos[pads.geoms].mean(axis=1)
        self.length = max(max(layout.size) for layout in pads.layouts)
        self.outward = -self.axes[:, :, 2]
        self._centers = triangles.mean(axis=1)
        self._radii = np.linalg.norm(triangles - self._centers[:, None], axis=2).max(axis=1)

    def hands(self) -> list[list[int]]:
        """Return the pads of each hand: those that lie near one another."""
        hands: list[list[int]] = []
        for pad, middle in enumerate(self.middle):
            near = [h for h in hands if np.linalg.norm(self.middle[h] - middle, axis=1).min() < _HAND]
            hands = [h for h in hands if h not in near] + [sorted([pad, *(p for h in near for p in h)])]
        return sorted(hands)

    def is_large(self, hands: list[list[int]]) -> bool:
        """Tell whether the robot is so large that its hands look small."""
        if not len(self.triangles):
            return False
        return float(np.ptp(self.triangles, axis=(0, 1)).max()) / 2 > _SMALL * max(map(self.reach, hands))

    def reach(self, hand: list[int]) -> float:
        """Return the distance (m) from the middle of a hand's pads to the edge of what a picture of it shows."""
        middle = self.middle[hand]
        return float(np.linalg.norm(middle - middle.mean(axis=0), axis=1).max()) + _AROUND + self.length / 2

    def draw_robot(self, ax: Any) -> None:
        """Draw the whole robot and rings around its pads."""
        view = _view(np.radians(20), np.radians(-60))
        self._show(ax, render(self.triangles, view, *self._everything(view), _PIXELS))
        ax.plot(*(self.middle @ view[:2].T).T, "o", color=_RED, fillstyle="none", markersize=7, zorder=3)

    def draw_hand(self, ax: Any, hand: list[int]) -> None:
        """Draw one hand from the side from which most of its pads can be seen, with their numbers."""
        view = self.best_view(hand)
        whole = self._everything(view)
        middle = self.middle[hand] @ view[:2].T
        center, half, triangles = *whole, self.triangles
        if self.is_large([hand]):
            center, half = middle.mean(axis=0), self.reach(hand)
            triangles = self._near(self.middle[hand].mean(axis=0), 2 * half)
        self._show(ax, render(triangles, view, center, 1.15 * half, _PIXELS))
        for pad in hand:
            self._draw_pad(ax, pad, view)
            self._arrow(ax, pad, view, 0.12 * half)
        self._number(ax, hand, middle, center, half)

    def draw_close(self, front: Any, side: Any, pad: int) -> None:
        """Draw one pad from close by: its face with row 0 at the top in `front`, and from the side in `side`."""
        half = _WIDE * max(self.pads.layouts[pad].size)
        triangles = self._near(self.middle[pad], 2 * half)
        x, y, outward = self.axes[pad, :, 0], self.axes[pad, :, 1], self.outward[pad]
        along = self._towards_tip(pad)
        picture = self._render(triangles, np.stack([x, -y, outward]), pad, half, self.length)
        self._show(front, picture)
        self._draw_pad(front, pad, picture.view, picture)
        self._name_ends(front, pad, picture, along)
        self._name_first(front, pad, picture)
        title = textwrap.fill(f"{pad + 1} {self.pads.names[pad]}", _TITLE)
        front.set_title(title, fontsize=8, color=_RED, parse_math=False)
        # the finger is upright or lies in both pictures
        height, width = self.pads.layouts[pad].size
        if abs(along[0]) > abs(along[1]):
            view, wide = np.stack([x, outward, y]), height
        else:
            view, wide = np.stack([-outward, -y, x]), width
        picture = self._render(triangles, view, pad, half, wide / 2 + _BESIDE)
        self._show(side, picture)
        self._draw_side(side, pad, picture.view)
        self._arrow(side, pad, picture.view, 0.4 * half)
        self._name_ends(side, pad, picture, along)
        side.set_xlim(picture.center[0] - ASIDE * half, picture.center[0] + ASIDE * half)

    def _render(
        self, triangles: NDArray[np.float64], view: NDArray[np.float64], pad: int, half: float, before: float
    ) -> Picture:
        """Draw what surrounds a pad, without what is more than `before` nearer to the viewer than its middle."""
        right, up, depth = view @ self.middle[pad]
        return render(triangles, view, np.array([right, up]), half, _PIXELS, float(depth) + before)

    def _towards_tip(self, pad: int) -> NDArray[np.float64]:
        """Return the direction from the base of a pad's finger to the pad, along its x and y; zero if it is unknown.

        The base is the last hinge of the finger, or the body on which the finger slides.
        """
        model, link = self.model, int(self.model.body_weldid[self.pads.bodies[pad]])
        if not link:
            return np.zeros(2)
        joints = np.arange(model.body_jntadr[link], model.body_jntadr[link] + model.body_jntnum[link])
        hinges = joints[model.jnt_type[joints] == int(mujoco.mjtJoint.mjJNT_HINGE)]
        base = self.data.xanchor[hinges[-1]] if len(hinges) else self.data.xpos[model.body_parentid[link]]
        along = (self.middle[pad] - base) @ self.axes[pad, :, :2]
        return along if np.linalg.norm(along) > self.length / 4 else np.zeros(2)

    def _name_ends(self, ax: Any, pad: int, picture: Picture, along: NDArray[np.float64]) -> None:
        """Write "tip" and "palm" at the edges of a close-up, towards these ends of the pad."""
        if not along.any():
            return
        main = int(np.argmax(np.abs(along)))
        towards = picture.view[:2] @ self.axes[pad, :, main] * np.sign(along[main])
        style = {"fontsize": 7, "color": _INK, "ha": "center", "va": "center", "zorder": 4}
        for text, sign in (("tip", 1), ("palm", -1)):
            ax.text(*(picture.center + sign * 0.93 * picture.half * towards), text, bbox=_LABEL, **style)

    def _name_first(self, ax: Any, pad: int, picture: Picture) -> None:
        """Write beside the face of a grid which taxels are its row 0 and its column 0."""
        layout = self.pads.layouts[pad]
        if min(layout.rows, layout.cols) < 2:
            return
        geoms = self.pads.geoms[pad]
        (x, y), gap = self.data.geom_xpos[geoms[0]] @ picture.view[:2].T, 0.05 * picture.half
        style = {"fontsize": 6, "color": _RED, "bbox": _LABEL, "zorder": 4}
        ax.text(x - layout.pitch[1] / 2 - gap, y, "row 0", ha="right", va="center", **style)
        ax.text(x, y + layout.pitch[0] / 2 + gap, "col 0", ha="center", va="bottom", **style)

    def best_view(self, hand: list[int]) -> NDArray[np.float64]:
        """Return the view, from a little above, from which the pads of a hand are seen best."""
        views = [_view(np.radians(20), np.radians(azimuth)) for azimuth in range(-60, 300, 15)]
        views += [_view(np.radians(60), np.radians(azimuth)) for azimuth in range(-60, 300, 30)]
        facing = np.array([self.outward[hand] @ view[2] for view in views])
        # of two pads that face each other, one should be seen, but not the back of the other
        seen = np.clip(facing, 0, _SEEN) + np.clip(facing + _SEEN, -1, 0) + 0.2 * facing
        steep = np.array([view[2, 2] for view in views])
        return views[int(np.argmax(np.round(seen.mean(axis=1) - 0.1 * steep, 3)))]

    def _everything(self, view: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        corners = np.concatenate([self.triangles.reshape(-1, 3), self.middle]) @ view[:2].T
        low, high = corners.min(axis=0), corners.max(axis=0)
        return (low + high) / 2, 0.53 * float((high - low).max()) + self.length / 2

    def _near(self, point: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
        """Return the triangles within a distance of a point, to leave out the rest of the robot."""
        return self.triangles[np.linalg.norm(self._centers - point, axis=1) - self._radii < reach]

    def _show(self, ax: Any, picture: Picture) -> None:
        (x, y), half = picture.center, picture.half
        extent = (x - half, x + half, y - half, y + half)
        ax.imshow(picture.rgba, origin="lower", extent=extent, zorder=1, interpolation="antialiased")
        ax.set_autoscale_on(False)

    def _draw_pad(self, ax: Any, pad: int, view: NDArray[np.float64], picture: Picture | None = None) -> None:
        """Draw a pad's taxels; those covered in `picture` hollow, and only an outline if the whole pad faces away."""
        from matplotlib.collections import PolyCollection
        from scipy.spatial import ConvexHull

        model, geoms = self.model, self.pads.geoms[pad]
        size, axes = model.geom_size[geoms], self.data.geom_xmat[geoms].reshape(-1, 3, 3)
        middles = self.data.geom_xpos[geoms][:, None]
        if int(model.geom_type[geoms[0]]) == int(mujoco.mjtGeom.mjGEOM_SPHERE):
            corners = middles + size[:, None, :1] * (_CIRCLE @ view[:2])
            fronts = middles[:, 0] - size[:, :1] * axes[:, :, 2]
        else:  # the outward face of a cube is at -z
            face = np.concatenate([_SQUARE, np.full((len(_SQUARE), 1), -1.0)], axis=1) * size[:, None]
            corners = middles + face @ axes.transpose(0, 2, 1)
            fronts = corners.mean(axis=1)
        facing = -axes[:, :, 2] @ view[2]
        flat = corners @ view[:2].T
        if facing.max() > 0:
            seen = np.flatnonzero(facing > 0)
            seen = seen[np.argsort((corners[seen] @ view[2]).mean(axis=1))]
            colors = np.tile([*_RED, 1.0], (len(geoms), 1))
            colors[0, :3] = 1.0
            edges = np.ones((len(geoms), 4))
            edges[0, :3] = _RED
            if picture is not None:
                colors[1:, 3] = _THROUGH
                covered = picture.covered(fronts, _COVER)
                colors[covered, 3] = 0
                edges[covered, :3] = _RED
            style = {"facecolors": colors[seen], "edgecolors": edges[seen], "linewidths": 0.4}
            ax.add_collection(PolyCollection(list(flat[seen]), zorder=2, **style))
        else:
            points = flat.reshape(-1, 2)
            hull = points[ConvexHull(points, qhull_options="QJ").vertices]
            style = {"facecolors": (0, 0, 0, 0), "edgecolors": [_RED], "linestyles": "dashed", "linewidths": 1}
            ax.add_collection(PolyCollection([hull], zorder=2, **style))

    def _draw_side(self, ax: Any, pad: int, view: NDArray[np.float64]) -> None:
        """Draw the outlines of a pad's taxels, the nearest last."""
        from matplotlib.collections import PolyCollection
        from scipy.spatial import ConvexHull

        model, geoms = self.model, self.pads.geoms[pad]
        geoms = geoms[np.argsort(self.data.geom_xpos[geoms] @ view[2], kind="stable")]
        middles = self.data.geom_xpos[geoms] @ view[:2].T
        if int(model.geom_type[geoms[0]]) == int(mujoco.mjtGeom.mjGEOM_SPHERE):
            outlines = list(middles[:, None] + model.geom_size[geoms][:, None, :1] * _CIRCLE)
        else:
            corners = _CUBE * model.geom_size[geoms][:, None]
            axes = self.data.geom_xmat[geoms].reshape(-1, 3, 3)
            flat = middles[:, None] + corners @ axes.transpose(0, 2, 1) @ view[:2].T
            outlines = [points[ConvexHull(points, qhull_options="QJ").vertices] for points in flat]
        style = {"facecolors": [_RED], "edgecolors": "white", "linewidths": 0.3}
        ax.add_collection(PolyCollection(outlines, zorder=2, **style))

    def _arrow(self, ax: Any, pad: int, view: NDArray[np.float64], length: float) -> None:
        ends = np.array([self.middle[pad], self.middle[pad] + length * self.outward[pad]]) @ view[:2].T
        style = {"arrowstyle": "-|>", "color": _INK, "linewidth": 1.3, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", ends[1], ends[0], arrowprops=style, zorder=3)

    def _number(
        self,
        ax: Any,
        hand: list[int],
        middle: NDArray[np.float64],
        center: NDArray[np.float64],
        half: float,
    ) -> None:
        """Write the pads' numbers at the left and right edges, apart from one another, with lines to the pads."""
        order = np.argsort(middle[:, 0], kind="stable")
        for side, which in ((-1, order[: (len(order) + 1) // 2]), (1, order[(len(order) + 1) // 2 :])):
            which = which[np.argsort(middle[which, 1], kind="stable")]
            heights = _apart(middle[which, 1], 0.16 * half)
            for index, y in zip(which, heights, strict=True):
                x = center[0] + side * 1.1 * half
                ax.plot([x - side * 0.05 * half, middle[index, 0]], [y, middle[index, 1]], color=_RED, lw=0.6, zorder=3)
                ax.text(x, y, str(hand[index] + 1), fontsize=10, color=_RED, ha="center", va="center", zorder=4)


def _apart(values: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Return sorted values moved until they are at least `least` apart, around the same mean."""
    steps = np.arange(len(values)) * least
    moved = np.maximum.accumulate(values - steps) + steps
    return moved - (moved - values).mean() if len(values) else moved


def _view(elevation: float, azimuth: float) -> NDArray[np.float64]:
    """Return the view for these viewing angles (rad)."""
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.stack([right, np.cross(towards, right), towards])
