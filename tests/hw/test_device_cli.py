"""``paxisim device``: guided check and quality measurement against the emulator, and the inputs they refuse."""

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from person import person

pytest.importorskip("serial")

from paxisim.cli.device import device_check, device_profiles, device_quality
from paxisim.errors import InvalidValueError, OutputExistsError, PaxisimError, UnknownNameError
from paxisim.hw.commissioning.check import check_steps
from paxisim.hw.commissioning.quality import MIN_FRAMES
from paxisim.hw.emulation.emulator import Emulator
from paxisim.hw.profiles.load import known_profiles, load_profile
from paxisim.hw.profiles.profile import Profile, Slot
from paxisim.hw.profiles.write import profile_toml

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning"),
]

SECONDS = 0.2


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


class User(io.StringIO):
    """Standard input of a user who presses the emulated sensor as the check asks, each time just before Enter.

    `mistakes` maps a step's name to the step that the user does in its place the first time. After `patience` answers
    the input ends.
    """

    def __init__(self, true: Profile, believed: Profile, mistakes=None, patience=100):
        super().__init__()
        self.true, self.steps, self.mistakes, self.patience = (
            true,
            list(check_steps(believed)),
            mistakes or {},
            patience,
        )
        self.asked = 0
        self.force = np.zeros((len(true.slots), *true.wire_layout.shape))

    def feel(self, seconds):
        return self.force

    def readline(self, size=-1):
        self.asked += 1
        if self.asked > self.patience:
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


def two_pads(like: str, indices=(0, 3)) -> Profile:
    return replace(load_profile(like), slots=(Slot("left", indices[0]), Slot("right", indices[1])))


def mirrored(profile: Profile) -> Profile:
    """The profile with other axes, swapped pads, and the bytes of a grid mirrored from right to left."""
    layout, slots = profile.wire_layout, profile.slots
    if profile.has_positions:
        order = np.array(layout.vendor_order)
        flipped = order // layout.cols * layout.cols + layout.cols - 1 - order % layout.cols
        layout = replace(layout, vendor_order=tuple(flipped.tolist()))
    if len(slots) == 2:
        slots = (Slot(slots[0].name, slots[1].index), Slot(slots[1].name, slots[0].index))
    return replace(profile, wire_layout=layout, axes=("-y", "+x", "+z"), slots=slots)


def run_check(monkeypatch, user: User, believed: Profile, output="mine.toml", **options):
    Path("believed.toml").write_text(profile_toml(believed), encoding="utf-8")
    monkeypatch.setattr("sys.stdin", user)
    with Emulator(user.true, user.feel) as emulator:
        device_check(emulator.port, "believed.toml", Path(output), seconds=SECONDS, **options)


BELIEVED = [
    two_pads("gen3-highspeed-mc-m2020"),
    load_profile("gen3-serial-mc-m2020"),
    two_pads("gen2-box-120", (2, 5)),
    load_profile("gen1-stream-pulp"),
]


@pytest.mark.parametrize("believed", BELIEVED, ids=lambda profile: profile.family)
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


def test_a_profile_that_is_right_is_found_right_and_keeps_its_pooling(monkeypatch, capsys):
    believed = replace(BELIEVED[0], pool=(3, 1))
    run_check(monkeypatch, User(replace(believed, pool=(1, 1)), believed), believed)
    found = load_profile("mine.toml")
    assert (found.layout, found.pool, found.axes) == (believed.layout, (3, 1), believed.axes)
    assert "right; wrote mine.toml" in capsys.readouterr().out


def test_counts_are_checked_against_the_noise_at_rest(monkeypatch, capsys):
    pytest.importorskip("websockets")
    believed = replace(load_profile("xela-uspa44"), slots=(Slot("left", 1), Slot("right", 2)))
    true = replace(believed, axes=("-y", "+x", "-z"), slots=(Slot("left", 2), Slot("right", 1)))
    user = User(true, believed)
    rng = np.random.default_rng(0)
    noisy = lambda now: 1500 * user.force + rng.normal(0, 20, user.force.shape)  # noqa: E731
    user.feel = noisy
    run_check(monkeypatch, user, believed)
    found = load_profile("mine.toml")
    assert (found.axes, found.slots, found.wire_layout) == (true.axes, true.slots, true.wire_layout)
    assert "counts of normal force" in capsys.readouterr().out


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


def test_what_was_not_felt_is_asked_for_again(monkeypatch, capsys):
    believed = BELIEVED[0]
    free = check_steps(believed)[0]
    user = User(believed, believed, mistakes={"top-left": free, "drag-right": free})
    run_check(monkeypatch, user, believed)
    assert user.asked == len(check_steps(believed)) + 2
    # on a busy machine the second mistake may be refused because it still includes the end of the previous press
    assert capsys.readouterr().out.count("Again:") == 2
    assert Path("mine.toml").exists()


def test_answers_that_contradict_write_nothing(monkeypatch, folder):
    believed = BELIEVED[0]
    user = User(believed, believed)
    user.steps = [replace(s, corner=None) if s.name == "top-right" else s for s in user.steps]
    with pytest.raises(InvalidValueError, match="contradict"):
        run_check(monkeypatch, user, believed)
    assert [path.name for path in folder.iterdir()] == ["believed.toml"]


@pytest.mark.parametrize("stop", [KeyboardInterrupt, None])
def test_stopping_half_way_leaves_nothing_behind(monkeypatch, folder, stop):
    believed = BELIEVED[0]
    user = User(believed, believed, patience=3)
    if stop:
        usual = user.readline

        def readline(size=-1):
            return usual(size) or (_ for _ in ()).throw(stop)

        user.readline = readline
    with pytest.raises(stop or InvalidValueError, match=None if stop else "nothing was written"):
        run_check(monkeypatch, user, believed)
    assert [path.name for path in folder.iterdir()] == ["believed.toml"]


def test_bad_arguments_are_refused_before_anything_is_opened():
    with pytest.raises(InvalidValueError, match=r"must be a \.toml file"):
        device_check("nowhere", "gen2-box-120", Path("mine.txt"))
    Path("mine.toml").write_text("precious")
    with pytest.raises(OutputExistsError):
        device_check("nowhere", "gen2-box-120", Path("mine.toml"))
    assert Path("mine.toml").read_text() == "precious"
    with pytest.raises(UnknownNameError):
        device_check("nowhere", "gen2-box-121", Path("new.toml"))
    with pytest.raises(PaxisimError, match="nowhere"):
        device_check("nowhere", "gen2-box-120", Path("new.toml"))
    with pytest.raises(InvalidValueError, match="--seconds"):
        device_quality("nowhere", "gen2-box-120", seconds=0)
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
