"""The cost of `import paxisim`, and the allowed imports between parts of paxisim."""

import ast
import functools
import os
import subprocess
import sys
from pathlib import Path

import pytest

import paxisim

PACKAGE = Path(paxisim.__file__).parent
INTEGRATIONS = PACKAGE.parent / "integrations"
# heavy or optional packages, which are imported when a name that needs them is first used
FORMATS = {"pyarrow", "rerun", "jinja2", "h5py", "mcap_ros2", "matplotlib", "trimesh"}
DEVICES = {"torch", "serial", "paxini_sdk", "robosuite", "mujoco_warp", "warp", "ray"}
OPTIONAL = FORMATS | DEVICES
HEAVY = OPTIONAL | {"mujoco", "numpy", "scipy", "lxml", "tyro", "mcap", "orjson"}

# a part may only import parts with a lower number; parts with the same number do not import each other
LEVELS = {
    0: "_renamed errors layout cluster parallel",
    0.5: "files",
    1: "bump sensors logs",
    1.5: "recording",
    1.7: "presses",
    2: "models augment hw calibrate",
    2.2: "reference",
    2.5: "scene warp",
    3: "diagnose viz",
    3.5: "protocols",
    4: "cli",
    5: "__main__",
}
LEVEL_OF = {part: level for level, parts in LEVELS.items() for part in parts.split()}
ANYWHERE = {"errors", "_version", "_renamed"}

# a class or function that calls, inside its methods, what is built on it: to load, save, run or report itself
FACADES = {
    "paxisim.augment.gcs": {"paxisim.augment.around"},
    "paxisim.diagnose.diagnosis": {"paxisim.diagnose.report.page"},
    "paxisim.hw.profile": {"paxisim.hw.profile_file"},
    "paxisim.protocols.protocol": {"paxisim.protocols.text"},
    "paxisim.scene.scene": {f"paxisim.scene.{name}" for name in ("changed", "replay", "rig", "toml")},
}

STAGES = [
    ("import paxisim", HEAVY),
    ("paxisim.sensor('paxini-gen1-l4629').layout.pool(2, 2); paxisim.known_sensors()", HEAVY - {"numpy"}),
    ("for name in paxisim.__all__: getattr(paxisim, name)", OPTIONAL),
    (
        """
import mujoco
pad = paxisim.Pad(paxisim.TaxelLayout(2, 2, 2e-3))
gripper = paxisim.attach("<mujoco><worldbody><body name='b'/></worldbody></mujoco>", pad, [paxisim.Mount("b")])
model = gripper.compile()
pads = gripper.bind(model)
paxisim.set_surface(model, pads, paxisim.GaussianBump((1, 1)).heights(pads.layout))
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
paxisim.TactileReadout(model, pads).read(data)
""",
        OPTIONAL,
    ),
]


def test_packages_are_imported_only_when_they_are_needed():
    """The layout and the catalogue need numpy alone; pads are built, attached and read without optional packages."""
    code = "import sys\n" + "".join(f"{stage}\nprint(*sys.modules)\n" for stage, _ in STAGES)
    path = os.pathsep.join([str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {"PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    for (stage, avoided), line in zip(STAGES, done.stdout.splitlines(), strict=True):
        imported = {name.split(".")[0] for name in line.split()}
        assert imported.isdisjoint(avoided), stage


@functools.cache
def syntax(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def files_to_check() -> list[Path]:
    """Return all files of paxisim but the top-level package, which imports lazily from everywhere."""
    left_out = {PACKAGE / "__init__.py", PACKAGE / "_version.py"}
    return [path for path in sorted(PACKAGE.rglob("*.py")) if path not in left_out]


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def parts_imported_by(path: Path) -> set[str]:
    """Return the parts of paxisim that a file imports, including imports in functions and for type checkers."""
    found = set()
    for node in ast.walk(syntax(path)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path} has a relative import"
            # `from paxisim import viz` imports a part; `from paxisim import Pad` imports the top-level package
            names = [f"paxisim.{alias.name}" for alias in node.names] if node.module == "paxisim" else [node.module]
        else:
            continue
        found |= {(name.split(".") + [""])[1] for name in names if name.split(".")[0] == "paxisim"}
    return found


def test_imports_run_one_way():
    files = files_to_check()
    assert parts_imported_by(PACKAGE / "models" / "pad.py") == {"errors", "layout", "models"}
    assert {part_of(path) for path in files} >= {"errors", "layout", "sensors", "models", "viz", "cli"}
    for path in files:
        part = part_of(path)
        assert part in LEVEL_OF, f"{part} is missing in LEVELS"
        # the command line may import the top-level package, like any user of the library
        for other in parts_imported_by(path) - ANYWHERE - {part} - ({""} if part == "cli" else set()):
            assert other in LEVEL_OF, f"{path} imports paxisim.{other}: import from the part that defines it"
            assert LEVEL_OF[other] < LEVEL_OF[part], f"{path}: {part} must not import {other}"


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


# __init__ files import their modules lazily; the modules do not import their package
MODULES = {module_of(path): path for path in files_to_check() if path.name != "__init__.py"}
PACKAGES = {module_of(path) for path in files_to_check() if path.name == "__init__.py"}


def modules_imported_by(name: str, known: set[str], *, later: bool = False) -> set[str]:
    """Return the modules of paxisim that a module imports at runtime; with `later` also those in functions."""
    found, open_ = set(), [syntax(MODULES[name])]
    while open_:
        node = open_.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.FunctionDef) and not later:
            continue
        open_ += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            modules = {f"{node.module}.{alias.name}" for alias in node.names} & known
            found |= modules | ({node.module} if len(modules) < len(node.names) else set())
    return found & known - {name}


def circle_in(imports: dict[str, set[str]]) -> list[str]:
    """Return modules that form an import cycle, in order; empty if there is none."""
    done: set[str] = set()

    def follow(name: str, way: list[str]) -> list[str]:
        if name in way:
            return way[way.index(name) :]
        if name in done:
            return []
        for other in sorted(imports.get(name, ())):
            if circle := follow(other, [*way, name]):
                return circle
        done.add(name)
        return []

    return next((circle for name in sorted(imports) if (circle := follow(name, []))), [])


def test_no_module_needs_itself_and_no_facade_is_needed_to_be_imported():
    """Imports in functions count, except those of a facade."""
    assert circle_in({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c"]
    assert circle_in({"a": {"b", "c"}, "b": {"c"}}) == []
    known = set(MODULES)
    later = {name: modules_imported_by(name, known, later=True) - FACADES.get(name, set()) for name in MODULES}
    assert circle_in(later) == []
    assert circle_in({name: modules_imported_by(name, known) for name in MODULES}) == []


def test_modules_of_the_diagnosis_do_not_reach_back_to_their_packages():
    for name in MODULES:
        if name.startswith("paxisim.diagnose."):
            imported = PACKAGES & modules_imported_by(name, PACKAGES | set(MODULES))
            assert not {package for package in imported if name.startswith(f"{package}.")}, name


@pytest.mark.skipif(not INTEGRATIONS.exists(), reason="no integrations yet")
def test_integrations_see_only_the_public_names():
    for path in INTEGRATIONS.rglob("*.py"):
        for node in ast.walk(syntax(path)):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module or ""]
                if node.module == "paxisim":
                    assert {alias.name for alias in node.names} <= set(paxisim.__all__), path
            assert not any(name.startswith("paxisim.") for name in names), path
