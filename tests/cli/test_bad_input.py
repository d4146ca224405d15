"""Bad input of every verb: one line on stderr with the salient word, status 2, and no file made or changed."""

import re
import shlex
from importlib.resources import files

import pytest
from load_rig import rig
from pressed_recording import pressed_recording

import paxisim
from paxisim.cli import main

GRID = "--rows 6 --cols 5 --pitch-mm 4.35,4.52"
BOARD = "gen3-highspeed-mc-m2020"
NO_FILE = r"no such file or folder: none\.\w+$"

# "-o a.xml" and "--profile ..." are added where a line has no output or profile and its verb needs one
ADDED = {
    "pad": "-o a.xml",
    "attach": "-o a.xml",
    "scene compose": "-o a.xml",
    "emulate": f"--seconds 0 --profile {BOARD}",
    "record": f"--profile {BOARD} -o press.mcap",
    "calibrate": "-o a.npz",
    "diagnose": "-o out",
    "live": "--save a.rrd --seconds 1",
    "protocol": "-o a.json",
    "replay": "-o a.npz",
}
BAD = {
    "": [
        ("dem", "unknown verb 'dem'; did you mean 'demo'.; see paxisim --help$"),
        ("grip", "unknown verb 'grip'; known: attach, calibrate, .*see paxisim --help$"),
        ("scene", "see paxisim scene --help$"),
        ("scene mak", "unknown verb of scene 'mak'; did you mean 'make'.*see paxisim scene --help$"),
        ("scene make", "see paxisim scene make --help$"),
        ("attach", "see paxisim attach --help$"),
        ("attach gripper.xml --fource", "see paxisim attach --help$"),
        ("attach none.xml --sensor anyskin", "no such model file: none.xml"),
        ("plot none.mcap", NO_FILE),
        ("record --profile a --seconds x", "--seconds must be a number, got 'x'"),
        ("demo --seed x", "--seed must be a whole number, got 'x'; see paxisim demo --help$"),
        ("demo --seed", "--seed needs a value; see"),
        ("demo --sede 3", "unknown option --sede, 3; did you mean --seed.; see paxisim demo --help$"),
        ("replay a.mcap", r"missing: --scene PATH \(Scene file, .toml\); see paxisim replay --help$"),
        ("emulate --profile nope", "unknown profile 'nope'; known: .* and .* more; `paxisim sensors` lists them$"),
        ("view gripper.xml", "no pads|no display|window"),
        ("demo --squeeze inf", "--squeeze must lie between"),
        ("demo --seed -1", "--seed must be 0 or more, got -1"),
        ("demo -o a.txt", r"must end in \.png, got a\.txt"),
        ("demo -o /proc/a.png", "cannot write /proc/a.png|folder does not exist"),
        ("example recording -o recording.csv", "mcap"),
        ("example gripper -o gripper.txt", "xml"),
        ("example gripper -o gripper.xml", "gripper.xml exists"),
        ("info none.mcap", NO_FILE),
        ("info text.mcap", "text.mcap"),
        ("convert a.mcap a.h5", "must end in .parquet, .csv, .npz or .mcap"),
        ("convert a.mcap a.mcap", "exists"),
        ("convert a.mcap no/b.npz", "folder does not exist"),
        ("convert a.mcap", "expected one of the two, got neither"),
        ("convert text.mcap b.npz", "text.mcap"),
        ("convert a.txt b.npz", "a.txt"),
    ],
    "pad": [
        ("--rows nan --cols 5 --pitch-mm 1", "--rows must be a whole number, got 'nan'"),
        (f"{GRID} --sensors all", "--sensors must be one of 'none', 'contact', 'touch_grid', got 'all'"),
        ("--rows 0 --cols 5 --pitch-mm 1", "rows must be .* at least 1, got 0"),
        ("--rows 6 --cols -5 --pitch-mm 1", "cols must be"),
        ("--rows 6 --cols 5 --pitch-mm 1,nan", "--pitch-mm must lie between 0.01 and 1000"),
        ("--rows 6 --cols 5 --pitch-mm 1e300", "--pitch-mm must .* got '1e300'"),
        ("--rows 6 --cols 5 --pitch-mm 1,2,3", "one or two numbers"),
        ("--rows 6 --cols 5", "all of --rows, --cols and --pitch-mm"),
        ("", "either --sensor NAME or"),
        (f"{GRID} --sensor paxini-gen1-l4629", "either --sensor NAME or"),
        (f"{GRID} --pool 4", "cannot pool 6x5 taxels in blocks of 4x4"),
        (f"{GRID} --subdivide 0", "cannot divide a taxel into 0x0"),
        (f"{GRID} --thickness-mm 0", "thickness must be positive"),
        ("--sensor paxini-gen1-14629", "did you mean 'paxini-gen1-l4629'"),
        (f"{GRID} -o no/such/folder/a.xml", "folder does not exist"),
        (f"{GRID} -o .", "is a folder"),
        (f"{GRID} -o a.png", r"must end in \.xml, got a\.png"),
        (f"{GRID} -o gripper.xml", "gripper.xml exists; --force overwrites it"),
    ],
    "attach": [
        (f"gripper.xml {GRID} -o a.png", r"must end in \.xml, got a\.png"),
        (f"gripper.xml {GRID} --picture a.txt", r"must end in \.png, got a\.txt"),
        (f"gripper.xml {GRID} --picture b.xml --force", r"must end in \.png"),
        (f"gripper.xml {GRID} --picture /proc/a.png", "cannot write /proc/a.png|folder does not exist"),
        (f"missing.xml {GRID}", "no such model file: missing.xml"),
        ("missing.xml --rows 4 --cols 4", "no such model file: missing.xml"),
        ("gripper.xml --rows 4 --cols 4", "a grid needs all of --rows, --cols and --pitch-mm"),
        (f"broken.xml {GRID}", "MuJoCo cannot parse broken.xml"),
        (f"padded.xml {GRID}", "padded.xml has pads of another shape already .left_pad 2x2."),
        (f"gripper.xml {GRID} --mount left_fingr", "did you mean 'left_finger'"),
        (f"gripper.xml {GRID} --mount pos-mm=1,2,3", "must begin with the name of a body"),
        (f"gripper.xml {GRID} --mount 'hand pos-mm'", "expected KEY=VALUE"),
        (f"gripper.xml {GRID} --mount 'hand pos-mm=a'", "numbers with commas"),
        (f"gripper.xml {GRID} --mount 'hand at=1'", "unknown key of a mount 'at'"),
        (f"gripper.xml {GRID} --mount 'hand replaces=x'", "unknown geom 'x'"),
        (f"gripper.xml {GRID} --mount 'hand replaces=hand/1'", "1 geom, there is no geom 1"),
        (f"gripper.xml {GRID} --mount 'hand replaces=\u00b2'", "unknown geom"),
        (f"gripper.xml {GRID} --mount 'hand quat=0,0,0,0'", "quat must not be zero"),
        (f"gripper.xml {GRID} --link a=b", "--xacro too"),
    ],
    "scene compose": [
        ("", "nothing that could touch an object: expected an arm, a hand, or both"),
        ("--hand missing.xml", "no such model file: missing.xml"),
        ("--hand text.xml", "MuJoCo cannot parse text.xml: expected MJCF or URDF"),
        ("--hand broken.xml", "MuJoCo cannot parse broken.xml"),
        ("--hand gripper.xml -o a.txt", r"must end in \.xml, got a\.txt"),
        ("--hand gripper.xml -o gripper.xml", "gripper.xml exists; --force overwrites it"),
        ("--hand gripper.xml --at hand", "expected an arm and a hand with it"),
        ("--arm gripper.xml --hand padded.xml", "expected at .--at., the body or site of gripper.xml"),
        ("--arm gripper.xml --hand padded.xml --at left_fingr", "did you mean 'left_finger'"),
        ("--hand gripper.xml --table 0,0", "a place must be X,Y,Z, three numbers up to 100 m, got '0,0'"),
        ("--hand gripper.xml --table 0,0,0", "left_finger and table would overlap by 5 mm"),
        ("--hand gripper.xml --object ball:30mm:1kg", "ball:30mm:1kg needs a place"),
        ("--hand gripper.xml --object ball:30:1kg", "an object must be box:AxBxCmm:MASSkg"),
        ("--hand gripper.xml --object ball:30mm:1kg@a", "a place must be X,Y,Z"),
    ],
    "emulate": [
        ("--profile gen3-highsped", "did you mean 'gen3-highspeed'"),
        ("--profile none.toml", "none.toml"),
        ("--profile gen1-pap-l4629 --signal padded.xml", r"\(1, 3, 12, 10\).*\(1, 3, 2, 2\)"),
        ("--signal none.mcap", "none.mcap"),
        ("--signal text.npz", "text.npz"),
        ("--signal none.xml", "no such model file"),
        ("--signal text.xml", "MuJoCo cannot parse"),
        ("--signal bare.xml", "no pads"),
        ("--signal press", "MODULE:FUNCTION, got 'press'"),
        ("--signal nowhere:press", "No module named 'nowhere'"),
        ("--signal broken:press", "broken:press.*invalid syntax"),
        ("--signal math:presss", "no attribute 'presss'"),
        ("--signal math:pi", "expected a function, got float"),
        ("--signal math:sin", r"of shape \(1, 3, 3, 3\)"),
        ("--signal math:log", "the signal failed at 0.000 s"),
        ("--fault dorp=1", "did you mean 'drop'"),
        ("--fault drop=7", "from 0 to 1"),
        ("--rate-hz 0", "rate must be"),
        ("--rate-hz nan", "rate must be"),
        ("--gate -2", "gate must be"),
        ("--shear-floor 200", "shear_floor must be from 0 to 127 counts, got 200"),
        ("--seed -1", "seed"),
        ("--seconds nan", "--seconds must be"),
        ("--link no/such/folder/pad", "folder does not exist"),
        ("--link /proc/l", "cannot write /proc/l|folder does not exist"),
        ("--link text.npz", "is no link to a port"),
        ("--link my-link", "is no link to a port"),
    ],
    "record": [
        ("", "expected the serial port"),
        ("nowhere", "nowhere"),
        ("nowhere --seconds 0", "--seconds must be more than 0, got 0"),
        ("nowhere --seconds nan", "--seconds must be more than 0, got nan"),
        ("nowhere --reconnect -1", "reconnect must be"),
        ("nowhere -o /proc/a.mcap", "cannot write /proc/a.mcap|folder does not exist"),
        ("nowhere -o press.csv", "must end in .mcap, got press.csv"),
        ("nowhere -o text.mcap", "text.mcap exists; --force overwrites it"),
        ("nowhere -o text.mcap --force", "nowhere"),
        ("nowhere -o no/such/folder/press.mcap", "folder does not exist"),
        ("nowhere --udp 70000", "udp must be a port number"),
        ("nowhere --csv file.csv", "--csv"),
        ("nowhere --stream no_such_module_x:f@5", "cannot import 'no_such_module_x'"),
        ("nowhere --stream time:time", "module:function@HZ"),
    ],
    "calibrate": [
        ("none.csv --loads load", NO_FILE),
        ("raw.mcap --loads Fz=Fzz", "unknown covariate 'Fzz'; did you mean 'Fz'"),
        ("raw.mcap --loads F=Fz", "unknown load component 'F'"),
        ("raw.mcap --loads Fz=Fz Fx", "COMPONENT=NAME for different components"),
        ("raw.mcap --loads Fz=Fz Fz=Fx", "COMPONENT=NAME for different components"),
        ("raw.mcap --loads Fz=", "COMPONENT=NAME for different components"),
        ("raw.mcap --loads Fz --degree 7", "degree must be 1, 2 or 3"),
        ("raw.mcap --loads Fz -o a.csv", r"calibration .\.json. or a calibrated recording .*got a\.csv"),
        ("raw.mcap --loads Fz -o b.npz", r"b\.png exists; --force overwrites it"),
    ],
    "diagnose": [
        ("none.mcap", NO_FILE),
        ("a.mcap --causes nothing", "unknown cause 'nothing'"),
        ("a.mcap -o a.mcap", "is a file"),
        ("a.mcap -o no/out", "does not exist"),
        ("a.mcap b.mcap -o a.mcap", "is a file"),
        ("a.mcap other/a.npz", "two recordings are named a"),
        ("a.mcap -o made", "--force"),
        ("", "expected a recording"),
    ],
    "live": [
        ("none.mcap", NO_FILE),
        ("none.xml", "no such model file"),
        ("bare.xml", "no pads"),
        ("notes.txt", "expected a recording"),
        ("damaged.npz", "damaged.npz"),
        ("/dev/none", "needs --profile"),
        ("/dev/none --profile gen2-boks-120", "did you mean 'gen2-box-120'"),
        ("padded.xml --profile gen2-box-120", "--profile is for a port"),
        ("padded.xml --seconds 0", "--seconds must be positive"),
        ("padded.xml --vmax 0", "vmax must be"),
        ("padded.xml --fps -1", "--fps must be"),
        ("padded.xml --save view.txt", "must end in .rrd"),
        ("padded.xml --save there.rrd", "there.rrd exists; --force overwrites it"),
        ("padded.xml --save none/view.rrd", "folder does not exist"),
    ],
    "protocol": [
        ("open-close --depth-mm 1", "open-close touches nothing: it takes no --depth-mm"),
        ("regrasp --sensor paxini-gen1-l4629", "regrasp is the same for every pad"),
        ("press -o a.toml", "the output must end in .json, got a.toml"),
        ("press --stop-n -3", "stop_force must be above 0 N, got -3"),
        ("pres", "must be one of 'press', 'regrasp', 'open-close', got 'pres'"),
    ],
    "replay": [("none.mcap --scene none.toml", NO_FILE)],
}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder with recordings, models and modules that the lines name, some of them broken."""
    folder = tmp_path_factory.mktemp("inputs")
    gripper = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    texts = {
        "gripper.xml": gripper,
        "broken.xml": "<mujoco><worldbody><geom/></mujoco>",
        "bare.xml": "<mujoco/>",
        "broken.py": "def press(:",
        **dict.fromkeys(["b.png", "there.rrd"], "mine"),
        **dict.fromkeys(["notes.txt", "text.npz", "text.xml", "text.mcap"], "some text"),
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    (folder / "damaged.npz").write_bytes(b"PK\x03\x04 not a recording")
    (folder / "my-link").symlink_to("text.npz")
    (folder / "made").mkdir()
    (folder / "made" / "model.json").write_text("mine")
    rig(seconds=10)[0].save(folder / "raw.mcap")
    pressed_recording().save(folder / "a.mcap")
    hand = "<mujoco><worldbody><body name='hand'/></worldbody></mujoco>"
    padded = paxisim.attach(hand, paxisim.Pad(paxisim.TaxelLayout(2, 2, 2e-3)), [paxisim.Mount("hand", name="left")])
    (folder / "padded.xml").write_text(padded.to_xml(folder))
    return folder


def contents(folder):
    """Return what is in a folder: the bytes of each file, and where a link leads."""
    return {path: path.readlink() if path.is_symlink() else path.is_file() and path.read_bytes()
            for path in folder.rglob("*") if "__pycache__" not in path.parts}  # fmt: skip


@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
@pytest.mark.parametrize("verb", BAD, ids=lambda verb: verb or "others")
def test_bad_input_is_one_line_and_status_2_and_changes_nothing(verb, inputs, monkeypatch, capsys):
    if verb == "live":
        pytest.importorskip("rerun", exc_type=ImportError)
    monkeypatch.chdir(inputs)
    before = contents(inputs)
    for line, said in BAD[verb]:
        words = shlex.split(f"{verb} {line}")
        options = ADDED.get(verb, "").split()
        for option, value in zip(options[::2], options[1::2], strict=True):
            words += [] if option in words else [option, value]
        capsys.readouterr()
        assert main(words) == 2, line
        errors = [text for text in capsys.readouterr().err.splitlines() if "warning" not in text]
        assert len(errors) == 1, (line, errors)
        assert re.search(said, errors[0]), (line, errors)
        assert contents(inputs) == before, line
