"""The documentation: it covers every public name, its commands exist, and its Python prints the stated output."""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest
from load_rig import rig

import paxisim
from paxisim.cli import main, parse
from paxisim.cli.example import example_recording

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
TEXTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
PACKAGE = Path(paxisim.__file__).parent

# pages whose Python runs in order as printed, with the packages they need; other pages have their own tests
RUN = {
    "getting-started.md": ("matplotlib",),
    "concepts/tensor.md": (),
    "concepts/gel.md": (),
    "concepts/chains.md": (),
    "guides/gripper.md": ("matplotlib",),
    "guides/randomisation.md": ("gymnasium", "torch"),
    "guides/gpu.md": ("torch",),
    "guides/warp.md": ("mujoco_warp", "torch"),
    "guides/diagnose.md": ("sklearn", "jinja2"),
    "guides/anyskin.md": (),
    "guides/magnetic-pad.md": (),
    "formats/tables.md": (),
}
SLOW = {"guides/diagnose.md", "how-to/add-a-cause.md"}  # a diagnosis; that of the README is not slow


def pages(*names):
    return [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in names]


def blocks(page, *kinds):
    """Return the fenced blocks of these kinds on a page, as (kind, text)."""
    found = re.findall(r"^```(\w*)[^\n]*\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return [(kind, text) for kind, text in found if kind in kinds]


def commands(page, first):
    """Return the commands in a page's shell blocks that begin with the word `first`, with continued lines joined."""
    lines = [line for _, text in blocks(page, "bash") for line in text.replace("\\\n", " ").splitlines()]
    return [line for line in lines if line.startswith(f"{first} ")]


def run(page, text, scope):
    """Run a block of Python and return what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(text, str(page), "exec"), scope)
    return out.getvalue()


# what pages name


def test_every_public_name_is_in_the_reference_once():
    texts = [page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md")]
    known = [name for text in texts for name in re.findall(r"^::: (\S+)$", text, re.MULTILINE)]
    assert len(known) == len(set(known)), "a name has two entries"
    parts = {"__version__", "augment", "diagnose", "warp"}  # of paxisim, with pages of their own
    for package in (paxisim, paxisim.augment, paxisim.diagnose, paxisim.warp):
        for name in {*package.__all__} - (parts if package is paxisim else set()):
            # names that paxisim re-exports from paxisim.augment are documented there
            assert {f"{package.__name__}.{name}", f"paxisim.augment.{name}"} & {*known}, name


def test_commands_files_and_links_of_the_pages_exist():
    for page in TEXTS:
        for line in commands(page, "paxisim"):
            words = shlex.split(line.partition(" > ")[0].removesuffix("&"), comments=True)[1:]
            assert words[0].startswith("--") or callable(parse(words)), line
        for line in commands(page, "python") + commands(page, "pytest"):
            for word in shlex.split(line, comments=True)[1:]:
                if re.fullmatch(r"(benchmarks|docs|examples|tests)(/[\w./]+)?", word):
                    assert (ROOT / word).exists(), line
        text = page.read_text(encoding="utf-8")
        named = re.findall(r"`((?:benchmarks|docs|examples|tests|paxisim|integrations)/[\w./-]+)`", text)
        if page.parent == ROOT:  # links within the site are checked by the build of the site
            named += [target for target in re.findall(r"\]\(([^)#\s]+)", text) if "://" not in target]
        assert [name for name in named if not (ROOT / name).exists()] == [], page


def test_the_navigation_has_every_page_and_the_pictures_exist():
    listed = re.findall(r"(?:- |: )([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md"))
    for page in [*TEXTS, ROOT / "integrations" / "README.md"]:
        text = page.read_text(encoding="utf-8")
        plain = re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", text)
        dark = r'<picture><source media="\(prefers-color-scheme: dark\)" srcset="(\S+)-dark\.png">'
        both = re.findall(dark + r'\s*<img src="\1\.png" alt="[^"]+"></picture>', text)
        assert len(both) == text.count("<img") == text.count("<source"), page
        named = plain + [name + end for name in both for end in (".png", "-dark.png")]
        assert [name for name in named if not (page.parent / name).is_file()] == [], page
        assert [name for name in plain if (page.parent / f"{name.removesuffix('.png')}-dark.png").is_file()] == [], page


def test_github_reads_the_markdown_within_figures():
    for page in TEXTS:
        bare = re.search(r"<(figure|figcaption) markdown>(?!\n\n)", page.read_text(encoding="utf-8"))
        assert bare is None, f"{page}: a blank line must follow {bare[0]}"


def test_the_page_of_examples_shows_those_there_are():
    text = (DOCS / "examples.md").read_text(encoding="utf-8")
    shown = re.findall(r'^--8<-- "examples/(\w+\.py)"$', text, re.MULTILINE)
    assert len(shown) >= 7
    assert all((ROOT / "examples" / name).is_file() for name in shown)
    named = set(re.findall(r"`(\w+\.(?:py|ipynb))`", text))
    there = {path.name for path in (ROOT / "examples").iterdir() if path.suffix in (".py", ".ipynb")}
    assert named == there
    assert set(re.findall(r'class="on-github" href="\.\./examples/([\w.]+)"', text)) == there, "for GitHub"


def test_the_page_on_the_architecture_names_every_part():
    page = (DOCS / "architecture.md").read_text(encoding="utf-8")
    named = {name.rstrip("/") for name in re.findall(r"^\| `([\w/.]+)`", page, re.M)}
    parts = {path for folder in ("paxisim", "integrations") for path in (ROOT / folder).iterdir()}
    there = {
        path.relative_to(ROOT).as_posix()
        for path in parts
        if (path / "__init__.py").exists()
        or (path / path.name / "__init__.py").exists()  # a distribution of its own
        or (path.suffix == ".py" and not path.name.startswith("_"))
    }
    assert named == there


# pages that run


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    gripper = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    (tmp_path / "my_gripper.xml").write_text(gripper)
    return tmp_path


@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", pages(*RUN))
def test_the_python_of_a_page_prints_what_it_says(name, folder):
    for module in RUN[name]:
        pytest.importorskip(module)
    if name == "guides/diagnose.md":
        example_recording().save("paired.mcap")
    scope, printed = {"__name__": "__main__"}, ""
    for kind, text in blocks(DOCS / name, "python", "text"):
        if kind == "text":
            assert printed == text
        else:
            printed = run(name, text, scope)


def write_files(page, folder):
    """Write the Python blocks of a page to the files that their first line names; return what each prints."""
    printed, name = {}, ""
    for kind, text in blocks(page, "python", "text"):
        if kind == "text":
            printed[name] = text
        elif named := re.match(r"# (\S+)\n", text):
            name = named[1]
            (folder / name).write_text(text, encoding="utf-8")
    return printed


def in_process(folder, script, package=PACKAGE.parent):
    """Run a script with warnings as errors and return what it prints."""
    path = os.pathsep.join([str(package), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-W", "error", script]
    environment = os.environ | {"PYTHONPATH": path}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=170)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.real_time
@pytest.mark.timeout(180)
@pytest.mark.parametrize("name", pages("how-to/add-a-board.md", "how-to/add-a-transform.md", "how-to/add-a-cause.md"))
def test_a_page_that_adds_something_prints_what_it_says(name, tmp_path):
    pytest.importorskip("serial")
    printed = write_files(DOCS / name, tmp_path)
    assert in_process(tmp_path, "try_it.py") == printed["try_it.py"]
    if name.endswith("cause.md"):
        assert len((tmp_path / "thermal_gain.py").read_text(encoding="utf-8").strip().splitlines()) < 40


def test_the_page_that_adds_a_sensor_does_so(tmp_path):
    """Run it in a copy of the package with the page's entry added to the catalogue."""
    page = DOCS / "how-to" / "add-a-sensor.md"
    printed = write_files(page, tmp_path)
    assert in_process(tmp_path, "my_sensor.py") == printed["my_sensor.py"]
    entry, profile = (text for _, text in blocks(page, "toml"))
    package = tmp_path / "copy" / "paxisim"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    with (package / "data" / "sensors.toml").open("a", encoding="utf-8") as catalogue:
        catalogue.write("\n" + entry)
    assert in_process(tmp_path, "try_it.py", package.parent) == printed["try_it.py"]
    (tmp_path / "acme.toml").write_text(profile, encoding="utf-8")
    assert paxisim.load_profile(tmp_path / "acme.toml").layout.shape == (3, 4, 6)


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_the_page_on_calibration_runs_as_printed(tmp_path, monkeypatch, capsys):
    pytest.importorskip("termios")  # for the emulator
    monkeypatch.chdir(tmp_path)
    recording = rig(seconds=20)[0]
    recording.save("raw.mcap")
    page = DOCS / "guides" / "calibrate.md"
    (record,) = commands(page, "paxisim record")
    for line in commands(page, "paxisim calibrate"):
        assert main([*line.split()[1:], "--force"]) == 0
    out = capsys.readouterr().out
    delay = re.search(r"the channels follow the loads by ([\d.]+) ms, 95% interval ([\d.]+) to ([\d.]+) ms", out)
    assert [float(word) for word in delay.groups()] == pytest.approx([30, 30, 30], abs=0.5)
    assert "gains in uT per N" in out
    assert out.count("\n0: 0,") == 2 * 15
    assert max(map(len, out.splitlines())) <= 80
    ready = paxisim.Recording.load("calibrated.mcap")
    assert (ready.measured - ready.simulated).std() < 0.03 * ready.simulated.std()
    assert ready.metadata["readout"]["loads"] == {name: name for name in ("Fx", "Fy", "Fz")}
    (_, fit), (_, live) = blocks(page, "python")
    scope: dict = {}
    run(page, fit, scope)
    assert len(scope["calibrated"]) == len(ready)
    assert Path("calibration.png").exists()
    with paxisim.Emulator("anyskin", lambda now: recording.measured[700]) as emulator:
        run(page, live.replace("/dev/ttyACM0", emulator.port), scope)
        words = record.replace("/dev/ttyACM0", emulator.port).split()[1:]
        assert main([*words, "--seconds", "0.5"]) == 0
    assert (scope["frame"].unit, scope["frame"].resultant.shape) == ("N", (1, 3))
    assert paxisim.Recording.load("newtons.mcap").unit == "N"


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_the_page_on_the_background_runs_as_printed(tmp_path, monkeypatch, capsys):
    pytest.importorskip("termios")  # for the emulator
    field_rig = pytest.importorskip("field_rig", reason="needs magpylib", exc_type=ImportError)
    monkeypatch.chdir(tmp_path)
    page = DOCS / "guides" / "background.md"
    field_rig.moving(0).save("free.mcap")
    press = field_rig.moving(1)
    load = 8 * abs(press.time % 4 - 2)
    measured = press.measured + 20 * load.reshape(-1, 1, 1, 1, 1)
    replace(press, measured=measured, covariates={**press.covariates, "cell": load}).save("press.mcap")
    for line in commands(page, "paxisim calibrate"):
        assert main(line.split()[1:]) == 0
    ((_, printed),) = blocks(page, "text")
    numbers = r"\d[\d.]*"
    said, expected = (re.sub(numbers, "#", text) for text in (capsys.readouterr().out, printed))
    assert expected in said
    ((_, live),) = blocks(page, "python")
    scope: dict = {}
    here = field_rig.field([0.04], [[0.0, 0.1]])[0] + 100
    Path("my_robot.py").write_text("def state():\n    return {'opening': 0.04, 'wrist': [0.0, 0.1]}\n")
    with paxisim.Emulator("anyskin", lambda now: here) as emulator:
        run(page, live.replace("/dev/ttyACM0", emulator.port), scope)
        record = commands(page, "paxisim record")[1].replace("/dev/ttyACM0", emulator.port)
        assert main([*record.split()[1:], "--seconds", "0.5", "--force"]) == 0
    assert abs(scope["frame"].force).max() < 1
    assert paxisim.Recording.load("less.mcap").metadata["background"] == ["opening", "wrist"]


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
@pytest.mark.filterwarnings("ignore:.*hold NaN")  # a busy machine loses frames of a sensor in real time
def test_the_page_on_the_driver_runs_as_printed(folder):
    for module in ("serial", "pyarrow", "rerun"):
        pytest.importorskip(module)
    page = DOCS / "guides" / "driver.md"
    emulate, *rest = commands(page, "paxisim")
    words = [sys.executable, "-m", "paxisim", *shlex.split(emulate.removesuffix("&"))[1:]]
    scope: dict = {}
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline().strip() == "my-sensor"
            for line in rest:
                assert main(shlex.split(line)[1:]) == 0, line
            for _, text in blocks(page, "python"):
                run(page, text, scope)
        finally:
            process.kill()
    assert scope["frame"].force.shape == (1, 3, 12, 10)
    assert scope["coarse"].measured.shape[1:] == (1, 3, 6, 5)
    for name in ("press.rrd", "press.parquet", "press-dataset/meta/info.json"):
        assert (folder / name).exists()
