"""``paxisim device``: guided check and quality measurement against the emulator, and the inputs they refuse."""

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from person import person

pytest.importorskip("serial")

from paxisim import (
    Emulator,
    InvalidValueError,
    OutputExistsError,
    PaxisimError,
    Slot,
    UnknownNameError,
    known_profiles,
    load_profile,
)
from paxisim.cli.device import device_check, device_profiles, device_quality
from paxisim.hw.commissioning.check import check_steps
from paxisim.hw.commissioning.quality import MIN_FRAMES
from paxisim.hw.profiles.write import profile_toml

pytestmark = [pytest.mark.real_time, pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")]

SECONDS = 0.2


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


class User(io.StringIO):
    """Standard input of a user who presses the emulated sensor as the check asks, each time just before Enter.

    `mistakes` maps a step's name to the step that the user does in its place the first time. After `patience` answers
    the input ends, or `stop` is raised.
    """

    def __init__(self, true, believed, mistakes=None, patience=100, stop=None):
        super().__init__()
        self.true, self.steps = true, list(check_steps(believed))
        self.mistakes, self.patience, self.stop = mistakes or {}, patience, stop
        self.asked = 0
        self.force = np.zeros((len(true.slots), *true.wire_layout.shape))

    def feel(self, seconds):
        return self.force

    def readline(self, size=-1):
        self.asked += 1
        if self.asked > self.patience:
            if self.stop is not None:
                raise self.stop
            return ""
        step = self.steps[0]
        done = self.mistakes.pop(step.name, None)
        if done is None:
            done = self.steps.pop(0)
        force = np.zeros_like(self.force)
        if done.name != "free":
            force[done.pad] = person(self.true.wire_layout, done)
        self.force = force
        return "\n"


def two_pads(like, indices=(0, 3)):
    return replace(load_profile(like), slots=(Slot("left", indices[0]), Slot("right", indices[1])))


def mirrored(profile):
    """The profile with other axes, swapped pads, and the bytes of a grid mirrored from right to left."""
    layout, slots = profile.wire_layout, profile.slots
    if profile.has_positions:
        order = np.array(layout.vendor_order)
        flipped = order // layout.cols * layout.cols + layout.cols - 1 - order % layout.cols
        layout = replace(layout, vendor_order=tuple(flipped.tolist()))
    if len(slots) == 2:
        slots = (Slot(slots[0].name, slots[1].index), Slot(slots[1].name, slots[0].index))
    return replace(profile, wire_layout=layout, axes=("-y", "+x", "+z"), slots=slots)


def run_check(monkeypatch, user, believed, output="mine.toml"):
    Path("believed.toml").write_text(profile_toml(believed), encoding="utf-8")
    monkeypatch.setattr("sys.stdin", user)
    with Emulator(user.true, user.feel) as emulator:
        device_check(emulator.port, "believed.toml", output=Path(output), seconds=SECONDS)


HIGH_SPEED = two_pads("gen3-highspeed-mc-m2020")
SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "believed",
    [
        HIGH_SPEED,
        load_profile("gen1-stream-pulp"),
        pytest.param(load_profile("gen3-serial-mc-m2020"), marks=SLOW),
        pytest.param(two_pads("gen2-box-120", (2, 5)), marks=SLOW),
    ],
    ids=lambda profile: profile.family,
)
def test_the_check_writes_the_profile_of_the_sensor_that_is_there(monkeypatch, capsys, believed):
    true = mirrored(believed)
    run_check(monkeypatch, User(true, believed), believed)
    found = load_profile("mine.toml")
    assert found.wire_layout == true.wire_layout
    assert (found.axes, found.slots, found.settings) == (true.axes, true.slots, true.settings)
    assert found.name == "mine"
    assert found.verified.startswith("paxisim device check, 20")
    said = capsys.readouterr().out
    order = "left and right must be exchanged" if believed.has_positions else "order: cannot be determined"
    assert order in said
    assert "wrong where marked with !; wrote mine.toml" in said
    assert max(map(len, said.splitlines())) <= 120


def test_a_right_profile_keeps_its_pooling_and_what_was_not_felt_is_asked_for_again(monkeypatch, capsys):
    believed = replace(HIGH_SPEED, pool=(3, 1))
    free = check_steps(believed)[0]
    user = User(replace(believed, pool=(1, 1)), believed, mistakes={"top-left": free, "drag-right": free})
    run_check(monkeypatch, user, believed)
    found, said = load_profile("mine.toml"), capsys.readouterr().out
    assert (found.layout, found.pool, found.axes) == (believed.layout, (3, 1), believed.axes)
    assert "right; wrote mine.toml" in said
    assert user.asked == len(check_steps(believed)) + 2
    # on a busy machine the second mistake may be refused because it still includes the end of the previous press
    assert said.count("Again:") == 2


def test_a_field_sensor_is_checked_for_chips_that_respond(monkeypatch, capsys):
    believed = load_profile("anyskin")
    dead = None

    def feel(now):
        noise = np.random.default_rng(int(1e4 * now)).normal(0, 0.5, (1, 3, 1, 5))
        if user.asked >= 2:
            noise[0, 1] += [30, 50, 20, 60, 40]
        if dead is not None:
            noise[..., dead] = 0
        return noise

    user = User(believed, believed)
    user.feel = feel
    run_check(monkeypatch, user, believed)
    said = capsys.readouterr().out
    assert "all 5 chips respond" in said
    assert "left and right" not in said
    found = load_profile("mine.toml")
    assert replace(found, name="anyskin", verified="") == believed
    assert found.verified.startswith("paxisim device check")

    dead, user = 3, User(believed, believed)
    user.feel = feel
    with pytest.raises(InvalidValueError, match=r"chip 3 of 5 \(in the order of the bytes, from 0\) does not respond"):
        run_check(monkeypatch, user, believed, "dead.toml")
    assert not Path("dead.toml").exists()


@pytest.mark.parametrize(
    ("stop", "error", "says"),
    [(KeyboardInterrupt(), KeyboardInterrupt, None), (None, InvalidValueError, "nothing was written")],
    ids=["Ctrl-C", "end of input"],
)
def test_a_check_that_is_stopped_leaves_nothing_behind(monkeypatch, folder, stop, error, says):
    with pytest.raises(error, match=says):
        run_check(monkeypatch, User(HIGH_SPEED, HIGH_SPEED, patience=3, stop=stop), HIGH_SPEED)
    assert [path.name for path in folder.iterdir()] == ["believed.toml"]


def test_bad_arguments_are_refused_before_anything_is_opened():
    Path("mine.toml").write_text("precious")
    for profile, output, error, says in (
        ("gen2-box-120", "mine.txt", InvalidValueError, r"must be a \.toml file"),
        ("gen2-box-120", "mine.toml", OutputExistsError, None),
        ("gen2-box-121", "new.toml", UnknownNameError, None),
        ("gen2-box-120", "new.toml", PaxisimError, "nowhere"),
    ):
        with pytest.raises(error, match=says):
            device_check("nowhere", profile, output=Path(output))
    with pytest.raises(InvalidValueError, match="--seconds"):
        device_quality("nowhere", "gen2-box-120", seconds=0)
    assert Path("mine.toml").read_text() == "precious"
    assert not Path("new.toml").exists()


def test_quality_prints_a_table_and_draws(capsys):
    pytest.importorskip("matplotlib")
    profile = load_profile("gen3-highspeed-mc-m2020")
    rng = np.random.default_rng(0)
    with Emulator(profile, lambda t: rng.normal(0.5, 0.1, (1, 3, 3, 3)), gate=0) as emulator:
        device_quality(emulator.port, profile.name, Path("quality.png"), seconds=SECONDS)
    said = capsys.readouterr().out
    frames = re.search(r"frames +(\d+) in", said)
    assert frames
    assert int(frames[1]) >= MIN_FRAMES
    assert "nominally 91" in said
    assert "0 of 9 taxels always read 0" in said
    assert "line: 0 bad checksums" in said
    assert max(map(len, said.splitlines())) <= 80
    assert Path("quality.png").read_bytes()[:4] == b"\x89PNG"


def test_profiles_are_listed_and_one_is_a_file_to_start_from(capsys):
    device_profiles()
    said = capsys.readouterr().out
    assert all(name in said for name in known_profiles())
    assert max(map(len, said.splitlines())) <= 80
    device_profiles("gen2-box-120")
    Path("copy.toml").write_text(capsys.readouterr().out, encoding="utf-8")
    assert load_profile("copy.toml") == load_profile("gen2-box-120")
