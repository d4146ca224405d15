"""Films of episodes, made from pictures that need no display."""

import cv2
import numpy as np
import pytest
from paxisim_insertion.play import play, write_film
from paxisim_insertion.shell import command
from PIL import Image


def pictures(count=12):
    """A bright square that moves to the right."""
    for index in range(count):
        picture = np.zeros((96, 192, 3), dtype=np.uint8)
        picture[30:60, 10 * index : 10 * index + 30] = (250, 120, 20)
        yield picture


def test_an_mp4_film(tmp_path):
    write_film(tmp_path / "film.mp4", pictures(), 20)
    film = cv2.VideoCapture(str(tmp_path / "film.mp4"))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 12
    assert film.get(cv2.CAP_PROP_FPS) == 20
    read, first = film.read()
    assert read
    assert first.shape == (96, 192, 3)
    np.testing.assert_allclose(first[45, 15, ::-1], (250, 120, 20), atol=40)
    film.release()


@pytest.mark.parametrize("suffix", ["gif", "webp"])
def test_an_animation_half_as_high(suffix, tmp_path):
    path = tmp_path / f"film.{suffix}"
    write_film(path, pictures(), 20)
    with Image.open(path) as film:
        assert (film.size, film.n_frames) == ((96, 48), 12)
        film.seek(11)
        last = np.asarray(film.convert("RGB"))
    assert last[22, 62, 0] > 150
    assert last[22, 10, 0] < 100


def test_what_is_no_film(tmp_path, capsys):
    assert command(play, ["--out", str(tmp_path / "film.avi")]) == 2
    assert "ends with one of .mp4, .gif, .webp" in capsys.readouterr().err
    (tmp_path / "film.gif").touch()
    assert command(play, ["--out", str(tmp_path / "film.gif")]) == 2
    assert "exists already" in capsys.readouterr().err
