"""Encodings: policy inputs computed from the force tensor; `paxisim.augment.history` keeps the last k frames.

The paper's baselines ("Comparative Evaluation"), by its abbreviations, and the centre of pressure. Shapes are for two
pads:

| name | class | policy input of k frames | k in the paper |
|---|---|---|---|
| NT | `NoTactile` | ``(0,)`` | - |
| TF | `TotalForce` | ``(6k,)`` N | 1 |
| TB | `TaxelBinarization` | ``(2k, rows, cols)`` of 0, 1 | 10 |
| TD | `TaxelDirection` | ``(6k, rows, cols)`` of -1, 0, 1 | 10 |
| DT | `DirectTransfer` | ``(6k, rows, cols)`` N | 10 |
| GCS | `GCSReading` | ``(6k, rows, cols)`` N, after a chain of `paxisim.augment.gcs` | 20 (10 for SY-2mm) |
| CoP | `CentreOfPressure` | ``(12k,)`` | - |

numpy in, numpy out; torch in, torch out, on the input's device.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from paxisim.augment.constant import constant, layout_text, read_layout
from paxisim.augment.parameter_spec import is_floating, namespace
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout

THRESHOLD = 0.1
"""Force threshold (N) above which a taxel counts as touched (paper, Section "Comparative Evaluation")."""


@dataclass(frozen=True)
class Encoding:
    """Base of the encodings, which turn a force tensor into a policy input.

    Attributes:
        layout: Layout of the pads' taxels.
    """

    name: ClassVar[str] = ""
    paper_history: ClassVar[int] = 1
    channels_per_pad: ClassVar[int] = 0
    is_image: ClassVar[bool] = False

    layout: TaxelLayout

    def shape(self, pads: int = 2, k: int = 1) -> tuple[int, ...]:
        """Return the shape of a policy input of `k` frames: ``(channels,)`` or ``(channels, rows, cols)``."""
        image = (self.layout.rows, self.layout.cols) if self.is_image else ()
        return (k * pads * self.channels_per_pad, *image)

    def encode(self, force: Any) -> Any:
        """Encode a frame or a stack of frames.

        Args:
            force: ``(..., pads, 3, rows, cols)`` forces (N), floating point.

        Returns:
            ``(..., *shape(pads))`` array of the same library, dtype and device.

        Raises:
            InvalidValueError: The shape is wrong, or the values are integers.
        """
        self.layout.check(force)
        if force.ndim < 4 or not is_floating(force):
            raise InvalidValueError(
                f"{type(self).__name__} expected a floating point tensor of shape (..., pads, 3, {self.layout.rows}, "
                f"{self.layout.cols}), got {force.dtype} of shape {tuple(force.shape)}"
            )
        return namespace(force).reshape(self._encode(force), (*force.shape[:-4], *self.shape(force.shape[-4])))

    def _encode(self, force: Any) -> Any:
        raise NotImplementedError


@dataclass(frozen=True)
class NoTactile(Encoding):
    """NT: no tactile input. ``(..., 0)``."""

    name: ClassVar[str] = "NT"

    def _encode(self, force: Any) -> Any:
        return force[..., :0, 0, 0, 0]


@dataclass(frozen=True)
class TotalForce(Encoding):
    """TF: total force, the sum over each pad's taxels. ``(..., 3 pads)`` newtons."""

    name: ClassVar[str] = "TF"
    channels_per_pad: ClassVar[int] = 3

    def _encode(self, force: Any) -> Any:
        return namespace(force).sum(force, axis=(-2, -1))


@dataclass(frozen=True)
class TaxelBinarization(Encoding):
    """TB: which taxels are touched. ``(..., pads, rows, cols)`` of 0 and 1.

    The paper binarises "the taxel reading" to one channel per pad without saying which of its three axes it uses. Our
    default is the magnitude of the force vector, which also responds to pure shear.

    Attributes:
        layout: Layout of the pads' taxels.
        threshold: Force (N) above which a taxel counts as touched.
        of: Quantity compared with the threshold: the force's ``"magnitude"`` or its ``"normal"`` component.
    """

    name: ClassVar[str] = "TB"
    paper_history: ClassVar[int] = 10
    channels_per_pad: ClassVar[int] = 1
    is_image: ClassVar[bool] = True

    threshold: float = THRESHOLD
    of: Literal["magnitude", "normal"] = "magnitude"

    def __post_init__(self) -> None:
        """Check the options."""
        if self.of not in ("magnitude", "normal"):
            raise InvalidValueError(f"TaxelBinarization: of must be 'magnitude' or 'normal', got {self.of!r}")

    def _encode(self, force: Any) -> Any:
        xp = namespace(force)
        felt = force[..., 2, :, :] if self.of == "normal" else xp.sqrt(xp.sum(force * force, axis=-3))
        return xp.astype(felt > self.threshold, force.dtype)


@dataclass(frozen=True)
class TaxelDirection(Encoding):
    """TD: sign of each force component of each taxel, 0 up to the threshold. ``(..., 3 pads, rows, cols)``.

    Attributes:
        layout: Layout of the pads' taxels.
        threshold: Magnitude (N) above which a component counts.
    """

    name: ClassVar[str] = "TD"
    paper_history: ClassVar[int] = 10
    channels_per_pad: ClassVar[int] = 3
    is_image: ClassVar[bool] = True

    threshold: float = THRESHOLD

    def _encode(self, force: Any) -> Any:
        xp = namespace(force)
        return xp.astype(force > self.threshold, force.dtype) - xp.astype(force < -self.threshold, force.dtype)


@dataclass(frozen=True)
class DirectTransfer(Encoding):
    """DT: the unchanged force tensor. ``(..., 3 pads, rows, cols)`` newtons."""

    name: ClassVar[str] = "DT"
    paper_history: ClassVar[int] = 10
    channels_per_pad: ClassVar[int] = 3
    is_image: ClassVar[bool] = True

    def _encode(self, force: Any) -> Any:
        return force


@dataclass(frozen=True)
class GCSReading(DirectTransfer):
    """GCS: as `DirectTransfer`, for a force tensor transformed by a chain from `paxisim.augment.gcs.GCS.sample`."""

    name: ClassVar[str] = "GCS"
    paper_history: ClassVar[int] = 20


@dataclass(frozen=True)
class CentreOfPressure(Encoding):
    """CoP: total force, centre of pressure and contact state of each pad. ``(..., 6 pads)``.

    The six values are the total force x, y, z (N), the centre of pressure x, y, and 1 in contact, else 0. The centre is
    the mean of the taxel positions weighted by normal force, in units of half the pad's extent, so that the edges are
    at -1 and 1; negative normal forces count as 0. Without contact it is 0, the middle.

    Attributes:
        layout: Layout of the pads' taxels.
        threshold: A pad is in contact if its taxels' positive normal forces sum to more than this (N).
        in_metres: Return the centre in metres, in the pad frame, instead.
    """

    name: ClassVar[str] = "CoP"
    channels_per_pad: ClassVar[int] = 6

    threshold: float = THRESHOLD
    in_metres: bool = False

    _text: ClassVar[str]  # set on each instance, but not a field

    def __post_init__(self) -> None:
        """Store the layout in the form that `constant` needs."""
        object.__setattr__(self, "_text", layout_text(self.layout))

    def _encode(self, force: Any) -> Any:
        xp = namespace(force)
        pressure = xp.reshape(xp.clip(force[..., 2, :, :], min=0), (*force.shape[:-3], self.layout.taxels))
        total = xp.sum(pressure, axis=-1)[..., None]
        contact = total > self.threshold
        moment = pressure @ constant(_places, (self._text, self.in_metres), force)
        center = xp.where(contact, moment / xp.where(contact, total, xp.ones_like(total)), xp.zeros_like(moment))
        return xp.concat([xp.sum(force, axis=(-2, -1)), center, xp.astype(contact, force.dtype)], axis=-1)


def _places(layout: str, in_metres: bool) -> Any:
    """``(N, 2)`` x, y of the taxels, in m, or in units of half the pad's extent from its middle."""
    taxels = read_layout(layout)
    places = taxels.positions[:, :2]
    if in_metres:
        return places
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    return (places - middle) / [taxels.size[1] / 2, taxels.size[0] / 2]


ENCODINGS: dict[str, type[Encoding]] = {
    kind.name: kind
    for kind in (
        NoTactile,
        TotalForce,
        TaxelBinarization,
        TaxelDirection,
        DirectTransfer,
        GCSReading,
        CentreOfPressure,
    )
}
"""Encodings by the paper's abbreviations."""


def encoding(name: str, layout: TaxelLayout, **options: Any) -> Encoding:
    """Create an encoding by the paper's abbreviation, e.g. ``encoding("TD", layout, threshold=0.2)``.

    Raises:
        UnknownNameError: There is no such encoding.
    """
    if name not in ENCODINGS:
        raise UnknownNameError("encoding", name, ENCODINGS)
    return ENCODINGS[name](layout, **options)
