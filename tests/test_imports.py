"""The cost of `import paxisim`, and the allowed imports between parts of paxisim."""

import ast
import functools
import os
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import paxisim

PACKAGE = Path(paxisim.__file__).parent
INTEGRATIONS = PACKAGE.parent / "integrations"
# heavy or optional packages, which are imported when a name that needs them is first used
FORMATS = {"pyarrow", "rerun", "jinja2", "h5py", "mcap_ros2", "rosbags", "matplotlib", "trimesh"}
DEVICES = {"torch", "serial", "paxini_sdk", "robosuite", "mujoco_warp", "warp", "ray"}
OPTIONAL = FORMATS | DEVICES
HEAVY = OPTIONAL | {"mujoco", "numpy", "scipy", "lxml", "tyro", "mcap", "orjson"}

# a part may only import parts with a lower number; parts with the same number do not import each other
LEVELS = {
    0: "errors layout cluster parallel",
    0.5: "files",
    0.7: "document",
    0.9: "sensors",
    1: "bump layer logs",
    1.5: "recording",
    1.7: "presses",
    2: "models augment hw calibrate",
    2.2: "reference",
    2.5: "scene warp",
    3: "diagnose viz",
    3.2: "cards",
    3.5: "protocols",
    4: "cli",
    5: "__main__",
}
LEVEL_OF = {part: level for level, parts in LEVELS.items() for part in parts.split()}
ANYWHERE = {"errors", "_version"}

# a class or function that calls, inside its methods, what is built on it: to load, save, run or report itself
FACADES = {
    "paxisim.cards.card": {"paxisim.cards.page"},
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


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def part_of(module: str) -> str:
    return (module.split(".") + [""])[1]


# the top-level package imports lazily from everywhere
FILES = {
    module_of(path): path for path in PACKAGE.rglob("*.py") if module_of(path) not in ("paxisim", "paxisim._version")
}
# __init__ files import their modules lazily; the modules do not import their package
MODULES = {name for name, path in FILES.items() if path.name != "__init__.py"}


def imported_by(name: str, *, later: bool = True, typing: bool = False) -> set[str]:
    """Return the modules and packages of paxisim that a file imports, ``"paxisim"`` for its public names.

    Args:
        name: Name of the module or package.
        later: Whether imports in functions count.
        typing: Whether imports for type checkers count.
    """
    found, open_ = set(), [syntax(FILES[name])]
    while open_:
        node = open_.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING" and not typing:
            continue
        if isinstance(node, ast.FunctionDef) and not later:
            continue
        open_ += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.split(".")[0] == "paxisim"}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{name} has a relative import"
            if node.module.split(".")[0] == "paxisim":
                # `from paxisim import viz` imports a part, `from paxisim import Pad` does not
                full = [f"{node.module}.{alias.name}" for alias in node.names]
                found |= {module if module in FILES else node.module for module in full}
    return found - {name}


def test_imports_run_one_way():
    assert {part_of(name) for name in imported_by("paxisim.models.pad")} == {"errors", "layout", "models"}
    assert {part_of(name) for name in FILES} >= {"errors", "layout", "sensors", "models", "viz", "cli"}
    for name in FILES:
        part = part_of(name)
        assert part in LEVEL_OF, f"{part} is missing in LEVELS"
        for other in map(part_of, imported_by(name, typing=True)):
            # the command line may import the top-level package, like any user of the library
            if other not in ANYWHERE | {part} and (other, part) != ("", "cli"):
                assert other in LEVEL_OF, f"{name} imports paxisim.{other}: import from the part that defines it"
                assert LEVEL_OF[other] < LEVEL_OF[part], f"{name}: {part} must not import {other}"


def test_no_module_needs_itself_and_no_facade_is_needed_to_be_imported():
    """Imports in functions count, except those of a facade."""
    later = {name: imported_by(name) & MODULES - FACADES.get(name, set()) for name in MODULES}
    for imports in (later, {name: imported_by(name, later=False) & MODULES for name in MODULES}):
        TopologicalSorter(imports).prepare()  # raises a CycleError that names the modules of a circle


def test_modules_of_the_diagnosis_do_not_reach_back_to_their_packages():
    for name in MODULES:
        if name.startswith("paxisim.diagnose."):
            assert not [other for other in imported_by(name) - MODULES if name.startswith(f"{other}.")], name


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


@pytest.mark.skipif(not INTEGRATIONS.exists(), reason="no integrations yet")
def test_no_module_of_the_integrations_needs_itself():
    """Imports in functions count."""
    imports = {}
    for path in INTEGRATIONS.glob("paxisim_*/**/*.py"):
        package = path.parent.relative_to(INTEGRATIONS).parts
        name = ".".join([*package, path.stem]).removesuffix(".__init__")
        found = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                start = package[: len(package) + 1 - node.level] if node.level else ()
                module = ".".join([*start, node.module or ""]).removesuffix(".")
                found |= {module} | {f"{module}.{alias.name}" for alias in node.names}
        imports[name] = found - {name}
    TopologicalSorter({name: found & set(imports) for name, found in imports.items()}).prepare()
