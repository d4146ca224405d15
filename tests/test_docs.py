"""The documentation: it covers every public name, its commands exist, and its Python prints the stated output."""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest

import paxisim
from paxisim.cli import main, parse
from paxisim.cli.example import example_recording

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
TEXTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES]

# pages whose Python runs in order as printed, with the packages they need; other pages have their own tests
RUN = {
    "getting-started.md": ("matplotlib",),
    "concepts/tensor.md": (),
    "concepts/gel.md": (),
    "concepts/chains.md": (),
    "guides/gripper.md": ("matplotlib",),
    "guides/randomisation.md": ("gymnasium",),
    "guides/gpu.md": ("torch",),
    "guides/warp.md": ("mujoco_warp", "torch"),
    "guides/diagnose.md": ("sklearn", "jinja2"),
    "guides/magnetic-pad.md": (),
    "formats/tables.md": (),
}


def blocks(page, *kinds):
    """Return the fenced blocks of these kinds on a page, as (kind, text)."""
    found = re.findall(r"^```(\w*)[^\n]*\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return [(kind, text) for kind, text in found if kind in kinds]


def commands(page, first):
    """Return the commands in a page's shell blocks that begin with the word `first`, with continued lines joined."""
    lines = [line for _, text in blocks(page, "bash") for line in text.replace("\\\n", " ").splitlines()]
    return [line for line in lines if line.startswith(f"{first} ")]


def reference():
    """Return the names in the API reference."""
    pages = [page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md")]
    names = [name for page in pages for name in re.findall(r"^::: (\S+)$", page, re.MULTILINE)]
    assert len(names) == len(set(names)), "a name has two entries"
    return set(names)


@pytest.mark.parametrize(
    ("package", "names"),
    [
        ("paxisim", {*paxisim.__all__} - {"__version__", "augment", "diagnose", "warp"}),
        ("paxisim.augment", {*paxisim.augment.__all__}),
        ("paxisim.diagnose", {*paxisim.diagnose.__all__}),
        ("paxisim.warp", {*paxisim.warp.__all__}),
    ],
)
def test_every_public_name_is_in_the_reference(package, names):
    known = reference()
    missing = sorted(name for name in names if f"{package}.{name}" not in known)
    # names that paxisim re-exports from paxisim.augment are documented there
    assert [n for n in missing if f"paxisim.augment.{n}" not in known] == []


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_are_ones_that_there_are(page):
    for line in commands(page, "paxisim"):
        words = shlex.split(line.partition(" > ")[0].removesuffix("&"), comments=True)[1:]
        if not words[0].startswith("--"):
            assert callable(parse(words)), line
    for line in commands(page, "python") + commands(page, "pytest"):
        for word in shlex.split(line, comments=True)[1:]:
            if re.fullmatch(r"(benchmarks|docs|examples|tests)(/[\w./]+)?", word):
                assert (ROOT / word).exists(), line


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_of_the_repository_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"`((?:benchmarks|docs|examples|tests|paxisim|integrations)/[\w./-]+)`", text)
    assert [name for name in named if not (ROOT / name).exists()] == []


@pytest.mark.parametrize("page", [page for page in TEXTS if page.parent == ROOT], ids=lambda page: page.name)
def test_links_of_the_pages_outside_the_site_lead_somewhere(page):
    """Links within the site are checked by the build of the site."""
    targets = re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))
    local = [target for target in targets if "://" not in target]
    assert [target for target in local if not (ROOT / target).exists()] == []


def test_the_page_of_examples_shows_those_there_are():
    text = (DOCS / "examples.md").read_text(encoding="utf-8")
    shown = re.findall(r'^--8<-- "examples/(\w+\.py)"$', text, re.MULTILINE)
    assert len(shown) >= 7
    assert all((ROOT / "examples" / name).is_file() for name in shown)
    named = set(re.findall(r"`(\w+\.(?:py|ipynb))`", text))
    assert named == {path.name for path in (ROOT / "examples").iterdir() if path.suffix in (".py", ".ipynb")}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    gripper = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    (tmp_path / "my_gripper.xml").write_text(gripper)
    return tmp_path


@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", RUN)
def test_the_python_of_a_page_prints_what_it_says(name, folder):
    for module in RUN[name]:
        pytest.importorskip(module)
    if name == "guides/diagnose.md":
        example_recording().save("paired.mcap")
    scope, printed = {"__name__": "__main__"}, ""
    for kind, text in blocks(DOCS / name, "python", "text"):
        if kind == "text":
            assert printed == text
            continue
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(compile(text, name, "exec"), scope)
        printed = out.getvalue()


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
@pytest.mark.filterwarnings("ignore:.*hold NaN")  # a busy machine loses frames of a sensor in real time
def test_the_page_on_the_driver_runs_as_printed(folder):
    pytest.importorskip("serial")
    pytest.importorskip("pyarrow")
    pytest.importorskip("rerun")
    page = DOCS / "guides" / "driver.md"
    emulate, *rest = commands(page, "paxisim")
    words = [sys.executable, "-m", "paxisim", *shlex.split(emulate.removesuffix("&"))[1:]]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline().strip() == "my-sensor"
            for line in rest:
                assert main(shlex.split(line)[1:]) == 0, line
            scope = {}
            for _, text in blocks(page, "python"):
                exec(compile(text, str(page), "exec"), scope)
        finally:
            process.kill()
    assert scope["frame"].force.shape == (1, 3, 12, 10)
    assert scope["coarse"].measured.shape[1:] == (1, 3, 6, 5)
    assert (folder / "press.rrd").exists()
    assert (folder / "press.parquet").exists()
    assert (folder / "press-dataset" / "meta" / "info.json").exists()


PACKAGE = Path(paxisim.__file__).parent


def in_process(folder, script, package=PACKAGE.parent):
    path = os.pathsep.join([str(package), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {"PYTHONPATH": path}
    command = [sys.executable, "-W", "error", script]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=100)


def python_files(page):
    """Return the Python blocks that begin with a comment naming their file, and the printed output of each."""
    found, name = {}, ""
    for kind, text in blocks(page, "python", "text"):
        if kind == "python":
            name = re.match(r"# (\S+)\n", text)[1]
            found[name] = (text, "")
        else:
            found[name] = (found[name][0], text)
    return found


def test_the_page_that_adds_a_transform_prints_what_it_says(tmp_path):
    pages = python_files(DOCS / "how-to" / "add-a-transform.md")
    for name, (code, _) in pages.items():
        (tmp_path / name).write_text(code, encoding="utf-8")
    done = in_process(tmp_path, "try_it.py")
    assert done.returncode == 0, done.stderr
    assert done.stdout == pages["try_it.py"][1]


def test_the_page_that_adds_a_sensor_does_so(tmp_path):
    """Run it in a copy of the package with the page's entry added to the catalogue."""
    page = DOCS / "how-to" / "add-a-sensor.md"
    pages = python_files(page)
    for name, (code, _) in pages.items():
        (tmp_path / name).write_text(code, encoding="utf-8")
    done = in_process(tmp_path, "my_sensor.py")
    assert (done.returncode, done.stdout) == (0, pages["my_sensor.py"][1]), done.stderr

    entry, profile = (text for _, text in blocks(page, "toml"))
    package = tmp_path / "copy" / "paxisim"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    with (package / "data" / "sensors.toml").open("a", encoding="utf-8") as catalogue:
        catalogue.write("\n" + entry)
    done = in_process(tmp_path, "try_it.py", package.parent)
    assert (done.returncode, done.stdout) == (0, pages["try_it.py"][1]), done.stderr

    (tmp_path / "acme.toml").write_text(profile, encoding="utf-8")
    assert paxisim.load_profile(tmp_path / "acme.toml").layout.shape == (3, 4, 6)


def test_the_page_on_the_architecture_names_every_part():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = {name.rstrip("/") for name in re.findall(r"^\| `([\w/.]+)`", page, re.M)}
    parts = {path for folder in ("paxisim", "integrations") for path in (ROOT / folder).iterdir()}
    there = {
        path.relative_to(ROOT).as_posix()
        for path in parts
        if (path / "__init__.py").exists() or (path.suffix == ".py" and not path.name.startswith("_"))
    }
    assert named == there
