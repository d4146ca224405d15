"""Films of a recording in real time: its pads and its total force, and beside them the scene that replayed it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.files import whole_file
from paxisim.recording import Recording
from paxisim.scene.replay import Replay, SimulatedEpisode

if TYPE_CHECKING:
    from paxisim.viz.film_frame import FilmFrame

SUFFIXES = (".mp4", ".gif", ".webp")
"""Formats of films."""
PICTURE = ".png"
"""Format of a single frame of a recording's film, `picture_recording`."""
LONGEST = 60.0
"""Longest film (s); a longer recording is filmed from its beginning."""
RATE = 25
"""Frames per second."""

_CRF = "24"  # quality of an MP4: 18 is visually lossless, 28 is coarse
_COLORS = 96  # of a GIF, whose size grows with them


def check_film(path: Path, *others: str) -> None:
    """Check before any work that a film can be written.

    Args:
        path: The film.
        *others: Suffixes that the caller takes besides, for the message.

    Raises:
        InvalidValueError: The suffix is of no film.
        MissingExtraError: A package for it is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        *first, last = SUFFIXES
        picture = f"; a picture of its strongest moment in {' or '.join(others)}" if others else ""
        raise InvalidValueError(f"a film must end in {', '.join(first)} or {last}{picture}, got {path}")
    try:
        import matplotlib  # noqa: F401
        import PIL  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("matplotlib", "viz", "a film") from error
    if path.suffix.lower() == ".mp4":
        _av()


def film_recording(
    path: Path,
    recording: Recording,
    *,
    doubtful: NDArray[np.bool_] | None = None,
    scene: Callable[[float], Any] | None = None,
    progress: Callable[[float], None] | None = None,
) -> float:
    """Write a film of a recording in real time, up to `LONGEST` seconds of it; the file is complete or not there.

    Args:
        path: Output file, with one of `SUFFIXES`.
        recording: The recording, with one stream or both.
        doubtful: ``(T,)`` True where the span is shaded. Default: where only the simulated stream is unknown.
        scene: Function of the normal force (N) of full red that opens a `FilmedScene` of the recording's samples.
        progress: Callback with the share of the film that is written, from 0 to 1.

    Returns:
        The length of the film (s).

    Raises:
        InvalidValueError: The streams are in different units, or the path cannot be written.
        MissingExtraError: A package for it is not installed.
        UnsupportedError: MuJoCo cannot render the scene here.
    """
    check_film(path)
    samples = _samples(recording)
    shaded = _left_out(recording) if doubtful is None else doubtful
    frame = _frame(recording, shaded, scene is not None)
    opened = None if scene is None else scene(frame.vmax)

    def pictures() -> Iterator[NDArray[np.uint8]]:
        for number, sample in enumerate(samples):
            yield frame.picture(sample, None if opened is None else opened.picture(sample))
            if progress is not None:
                progress((number + 1) / len(samples))

    try:
        with whole_file(path) as temporary:
            _WRITERS[path.suffix.lower()](temporary, pictures())
    finally:
        if opened is not None:
            opened.close()
    return len(samples) / RATE


def picture_recording(path: Path, recording: Recording) -> float:
    """Write the frame of a recording's film at which the total normal force is largest, as PNG.

    Args:
        path: Output file.
        recording: The recording, with one stream or both.

    Returns:
        The time of the frame (s).

    Raises:
        InvalidValueError: The streams are in different units, or the path cannot be written.
        MissingExtraError: matplotlib or pillow is not installed.
    """
    check_film(path.with_suffix(".gif"))
    from PIL import Image

    frame = _frame(recording, _left_out(recording), False)
    force = recording.measured if recording.measured is not None else recording.simulated
    assert force is not None
    sample = int(np.nan_to_num(force[:, :, 2].sum(axis=(1, 2, 3)), nan=-np.inf).argmax())
    with whole_file(path) as temporary:
        Image.fromarray(frame.picture(sample, None)).save(temporary, "PNG")
    return float(recording.time[sample])


def _frame(recording: Recording, shaded: NDArray[np.bool_], has_scene: bool) -> FilmFrame:
    """Return the frame in which the samples of a recording are drawn."""
    if recording.unit != "N" and recording.measured is not None and recording.simulated is not None:
        raise InvalidValueError(
            f"measured is in {recording.unit} and simulated in N, so one scale cannot show both: convert the recording "
            "with paxisim calibrate"
        )
    from paxisim.viz.film_frame import FilmFrame

    return FilmFrame(recording, _clock(recording), shaded, has_scene)


def film_replay(
    path: Path,
    replay: Replay,
    episodes: Sequence[SimulatedEpisode],
    paired: Recording,
    progress: Callable[[float], None] | None = None,
) -> float:
    """Write a film of a replay, with the scene; the forces that are left out because they are in doubt are shown.

    Args:
        path: Output file, with one of `SUFFIXES`.
        replay: The replay; the colours of its model's taxels are changed.
        episodes: All its episodes, in the order of the recording.
        paired: What `Replay.paired` made of them.
        progress: Callback with the share of the film that is written, from 0 to 1.

    Returns:
        The length of the film (s).

    Raises:
        InvalidValueError: See `film_recording`.
        MissingExtraError: See `film_recording`.
        UnsupportedError: See `film_recording`.
    """
    from paxisim.viz.film_frame import SCENE
    from paxisim.viz.film_scene import FilmedScene

    force = np.concatenate([episode.force for episode in episodes])
    qpos = np.concatenate([episode.qpos for episode in episodes])
    whole = paired.with_simulated(force)
    doubtful = np.isfinite(force[:, 0, 0, 0, 0]) & np.isnan(paired.simulated[:, 0, 0, 0, 0])  # type: ignore[index]
    rig = replay.rig

    def scene(vmax: float) -> FilmedScene:
        return FilmedScene(rig.model, rig.pads, qpos, force, vmax, SCENE)

    return film_recording(path, whole, doubtful=doubtful, scene=scene, progress=progress)


def _left_out(recording: Recording) -> NDArray[np.bool_]:
    """Return where only the simulated stream is unknown, ``(T,)``: a replay leaves out what is in doubt."""
    if recording.measured is None or recording.simulated is None:
        return np.zeros(len(recording), dtype=bool)
    known = [np.isfinite(force).any(axis=(1, 2, 3, 4)) for force in (recording.measured, recording.simulated)]
    return known[0] & ~known[1]


def _clock(recording: Recording) -> NDArray[np.float64]:
    """Return times (s) that increase: the recording's, with each episode after the one before if its clock restarts."""
    if np.all(np.diff(recording.time) >= 0):
        return recording.time
    parts, end = [], 0.0
    for part in recording.episodes():
        parts.append(part.time - part.time[0] + end)
        end = float(parts[-1][-1]) + 1 / RATE
    return np.concatenate(parts)


def _samples(recording: Recording) -> list[int]:
    """Return the sample of each frame: the last one before it, without the time between two episodes."""
    found, first = [], 0
    for part in recording.episodes():
        at = np.arange(part.time[0], part.time[-1] + 0.5 / RATE, 1 / RATE)
        found += (first + np.searchsorted(part.time, at + 1e-9, side="right") - 1).tolist()
        first += len(part)
    return found[: round(LONGEST * RATE)]


def _av() -> Any:
    try:
        import av
    except ImportError as error:
        raise MissingExtraError("av", "film", "a film in MP4; without it, name one .gif or .webp") from error
    return av


def _write_mp4(path: Path, pictures: Iterator[NDArray[np.uint8]]) -> None:
    av = _av()
    first = next(pictures)
    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as file:
        stream = file.add_stream("libx264", rate=Fraction(RATE), options={"crf": _CRF})
        stream.height, stream.width = first.shape[:2]
        stream.pix_fmt = "yuv420p"  # what browsers play
        for picture in itertools.chain([first], pictures):
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        file.mux(stream.encode())


def _write_gif(path: Path, pictures: Iterator[NDArray[np.uint8]]) -> None:
    from PIL import Image

    small = (
        Image.fromarray(each).quantize(_COLORS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        for each in pictures
    )
    _save(next(small), small, path, "GIF")


def _write_webp(path: Path, pictures: Iterator[NDArray[np.uint8]]) -> None:
    from PIL import Image

    whole = (Image.fromarray(each) for each in pictures)
    _save(next(whole), whole, path, "WEBP", quality=60)


def _save(first: Any, others: Iterator[Any], path: Path, form: str, **options: Any) -> None:
    with path.open("wb") as file:
        duration = round(1000 / RATE)
        first.save(file, form, save_all=True, append_images=others, duration=duration, loop=0, **options)


_WRITERS = {".mp4": _write_mp4, ".gif": _write_gif, ".webp": _write_webp}
