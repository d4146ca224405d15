"""Films of recordings and of replays, from the shell."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
import offscreen
from PIL import Image

import paxisim
from paxisim.cli import main
from paxisim.recording import Recording
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(3, 3, (6e-3, 6e-3))
RATE = 25  # frames per second
WIDTH, HEIGHT = 960, 540
PADS = (slice(24, 356), slice(0, 860))  # lines and columns of the pads, without the names and the colour bar
PLOT = 384  # first line of the plot over time
SHADE = (243, 217, 164)


@pytest.fixture(scope="module")
def grasp(tmp_path_factory):
    """A folder with a scene, and a recording of a hand that holds its peg for 0.5 s longer than the scene's."""
    folder = tmp_path_factory.mktemp("grasp")
    scene = ready.gripper(LAYOUT, peg=True)
    scene.save(folder / "peg.toml")
    time = np.arange(0, 2, 0.02)
    opening = np.interp(time, [0.2, 0.6, 1.0, 1.1], [0.05, 0.0236, 0.0236, 0.05])
    blank = np.zeros((len(time), 2, 3, 3, 3), np.float32)
    recording = Recording(time, blank, covariates={"opening": opening}, layout=LAYOUT, pads=("left", "right"))
    measured = scene.simulate(recording).simulated
    longer = (time > 0.95) & (time < 1.5)
    measured[longer] = measured[time <= 0.95][-1]
    replace(recording, measured=measured).save(folder / "peg.mcap")
    return folder


@pytest.fixture(autouse=True)
def work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def frames(path):
    """Return all frames of a GIF or WebP, ``(frames, height, width, 3)``, checked to run in real time."""
    with Image.open(path) as film:
        found = []
        for index in range(film.n_frames):
            film.seek(index)
            found.append(np.asarray(film.convert("RGB")).astype(int))
            assert film.info["duration"] % (1000 / RATE) == 0  # a GIF shows equal frames as one
    return np.stack(found)


def red(pictures):
    """Return how many pixels of each picture are redder than a taxel at rest."""
    return (pictures[..., 0] - pictures[..., 1] > 30).sum(axis=(1, 2))


@pytest.mark.parametrize("suffix", ["gif", "webp"])
def test_a_recording_is_filmed_in_real_time(grasp, capsys, suffix):
    assert main(["plot", str(grasp / "peg.mcap"), "-o", f"film.{suffix}"]) == 0
    assert f"film.{suffix}: 2.0 s, " in capsys.readouterr().out
    with Image.open(f"film.{suffix}") as film:
        assert film.size == (WIDTH, HEIGHT)
    found = frames(f"film.{suffix}")
    if suffix == "webp":
        assert len(found) == 2 * RATE
    pressed = red(found[(slice(None), *PADS)])
    assert pressed[0] < 1000 < pressed.max(), "the pads turn red while they are pressed"
    assert [path.name for path in Path().iterdir()] == [f"film.{suffix}"]


def test_a_picture_shows_the_strongest_moment(grasp, capsys):
    assert main(["plot", str(grasp / "peg.mcap"), "-o", "all.png"]) == 0
    one = Recording.load(grasp / "peg.mcap")
    strongest = one.time[one.measured[:, :, 2].sum(axis=(1, 2, 3)).argmax()]
    assert f"all.png: the sample at {strongest:.2f} s, " in capsys.readouterr().out
    assert main(["plot", str(grasp / "peg.mcap"), "-o", "one.png", "--pads", one.pads[0]]) == 0
    pictures = [np.asarray(Image.open(name).convert("RGB")).astype(int) for name in ("all.png", "one.png")]
    assert all(picture.shape == (HEIGHT, WIDTH, 3) for picture in pictures)
    assert red(pictures[0][(None, *PADS)])[0] > 1000
    assert not np.array_equal(*pictures), "one pad is larger"
    assert main(["plot", str(grasp / "peg.mcap"), "-o", "none.png", "--pads", "middle"]) == 2
    assert "unknown pad 'middle'" in capsys.readouterr().err


def test_a_film_in_mp4(grasp):
    av = pytest.importorskip("av")
    assert main(["plot", str(grasp / "peg.mcap"), "-o", "film.mp4"]) == 0
    with av.open("film.mp4") as film:
        (stream,) = film.streams
        assert (stream.codec_context.name, stream.average_rate) == ("h264", RATE)
        found = np.stack([frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]).astype(int)
    assert found.shape == (2 * RATE, HEIGHT, WIDTH, 3)
    pressed = red(found[(slice(None), *PADS)])
    assert pressed[0] < 1000 < pressed.max()


def test_the_time_between_two_episodes_and_what_is_too_long_is_not_filmed(grasp, capsys, monkeypatch):
    once = Recording.load(grasp / "peg.mcap")
    time = np.concatenate([once.time, once.time + 500])
    twice = replace(
        once, time=time, measured=np.concatenate([once.measured] * 2), covariates={}, episode=np.repeat([0, 1], 100)
    )
    twice.save("twice.npz")
    for restarted in (False, True):
        at = np.concatenate([once.time] * 2) if restarted else time
        replace(twice, time=at).save("twice.npz")
        assert main(["plot", "twice.npz", "-o", "twice.webp", "--force"]) == 0
        assert len(frames("twice.webp")) == 4 * RATE
        assert "twice.webp: 4.0 s, " in capsys.readouterr().out
    monkeypatch.setattr("paxisim.viz.film.LONGEST", 1.0)
    assert main(["plot", "twice.npz", "-o", "short.webp"]) == 0
    assert "short.webp: 1.0 s, the first of 4 s, " in capsys.readouterr().out
    assert len(frames("short.webp")) == RATE


def test_a_replay_is_filmed_with_its_scene(grasp):
    words = ["replay", str(grasp / "peg.mcap"), "--scene", str(grasp / "peg.toml"), "-o", "paired.npz"]
    done = offscreen.python("-m", "paxisim", *words, "--film", "film.webp")
    assert done.returncode == 0, done.stderr
    assert "film.webp: 2.0 s, " in done.stdout
    assert {path.name for path in Path().iterdir()} == {"paired.npz", "film.webp"}
    found = frames("film.webp")
    assert len(found) == 2 * RATE
    scene = found[:, :356, :400]
    closing = np.abs(np.diff(scene[[0, 20, 24]], axis=0)).max(axis=-1) > 60
    assert closing[0].sum() > 2000 > closing[1].sum(), "the fingers move until they hold the peg"
    held, lost = red(found[[22, 32], PADS[0], 400:860])
    assert lost == pytest.approx(held / 2, rel=0.1), "the simulated pads are already free"
    shaded = (np.abs(found[10, PLOT:] - SHADE).max(axis=-1) < 12).any(axis=0)
    first, last = np.flatnonzero(shaded)[[0, -1]]
    left, right = 76, WIDTH - 20
    assert [2 * (column - left) / (right - left) for column in (first, last)] == pytest.approx([1.0, 2.0], abs=0.12)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["plot", "REC", "-o", "film.avi"],
            ".mp4, .gif or .webp; a picture of its strongest moment in .png, got film.avi",
        ),
        (["plot", "REC", "-o", "there.gif"], "there.gif exists; --force overwrites it"),
        (["plot", "missing.mcap", "-o", "film.gif"], "missing.mcap"),
        (["plot", "uT.npz", "-o", "film.gif"], "measured is in uT and simulated in N"),
        (["replay", "REC", "--scene", "SCENE", "-o", "paired.npz", "--film", "film.avi"], "must end in .mp4, .gif"),
        (["replay", "REC", "--scene", "SCENE", "-o", "paired.npz", "--film", "there.gif"], "there.gif exists"),
    ],
)
def test_what_cannot_be_filmed_is_one_line(grasp, capsys, words, said):
    Path("there.gif").touch()
    one = Recording.load(grasp / "peg.mcap")
    replace(one, simulated=one.measured, metadata={"unit": "uT"}).save("uT.npz")
    names = {"REC": str(grasp / "peg.mcap"), "SCENE": str(grasp / "peg.toml")}
    assert main([names.get(word, word) for word in words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert {path.name for path in Path().iterdir()} == {"there.gif", "uT.npz"}


@pytest.mark.parametrize(("module", "suffix", "extra"), [("av", "mp4", "film"), ("matplotlib", "gif", "viz")])
def test_a_missing_package_names_its_extra(grasp, capsys, monkeypatch, module, suffix, extra):
    monkeypatch.setitem(sys.modules, module, None)
    assert main(["plot", str(grasp / "peg.mcap"), "-o", f"film.{suffix}"]) == 2
    assert f"pip install 'paxisim[{extra}]'" in capsys.readouterr().err
    assert not list(Path().iterdir())


def test_a_film_that_fails_is_not_there(grasp, monkeypatch):
    def broken(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("paxisim.viz.film_frame.FilmFrame.picture", broken)
    assert main(["plot", str(grasp / "peg.mcap"), "-o", "film.gif"]) == 2
    assert not list(Path().iterdir())
