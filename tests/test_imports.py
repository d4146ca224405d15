"""The cost of `import paxisim`, and the allowed imports between parts of paxisim."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import paxisim

PACKAGE = Path(paxisim.__file__).parent
# heavy or optional packages, which are imported when a name that needs them is first used
OPTIONAL = {
    "torch",
    "serial",
    "matplotlib",
    "trimesh",
    "robosuite",
    "pyarrow",
    "rerun",
    "paxini_sdk",
    "jinja2",
    "h5py",
    "mcap_ros2",
    "mujoco_warp",
    "warp",
    "ray",
}
HEAVY = OPTIONAL | {"mujoco", "numpy", "scipy", "lxml", "tyro", "mcap", "orjson"}

# a part may only import parts with a lower number; parts with the same number do not import each other
LEVELS = {
    "_renamed": 0,
    "errors": 0,
    "files": 0.5,
    "layout": 0,
    "cluster": 0,
    "parallel": 0,
    "bump": 1,
    "sensors": 1,
    "logs": 1,
    "recording": 1.5,
    "presses": 1.7,
    "models": 2,
    "augment": 2,
    "reference": 2.2,
    "hw": 2,
    "calibrate": 2,
    "scene": 2.5,
    "warp": 2.5,
    "diagnose": 3,
    "viz": 3,
    "protocols": 3.5,
    "cli": 4,
    "__main__": 5,
}
ANYWHERE = {"errors", "_version", "_renamed"}


def modules_after(code: str) -> set[str]:
    """Return the top-level names of the modules that a fresh interpreter imports when it runs `code`."""
    path = os.pathsep.join([str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return {name.split(".")[0] for name in done.stdout.split()}


def test_import_paxisim_imports_nothing_heavy():
    assert modules_after("import paxisim").isdisjoint(HEAVY)


def test_the_layout_and_the_catalogue_need_numpy_alone():
    code = "import paxisim\npaxisim.sensor('paxini-gen1-l4629').layout.pool(2, 2)\npaxisim.known_sensors()"
    assert modules_after(code).isdisjoint(HEAVY - {"numpy"})


def test_every_public_name_can_be_used_without_the_optional_packages():
    code = "import paxisim\nfor name in paxisim.__all__: getattr(paxisim, name)"
    assert modules_after(code).isdisjoint(OPTIONAL)


def test_pads_are_built_attached_and_read_without_the_optional_packages():
    code = """
import mujoco, paxisim
pad = paxisim.Pad(paxisim.TaxelLayout(2, 2, 2e-3))
gripper = paxisim.attach("<mujoco><worldbody><body name='b'/></worldbody></mujoco>", pad, [paxisim.Mount("b")])
model = gripper.compile()
pads = gripper.bind(model)
paxisim.set_surface(model, pads, paxisim.GaussianBump((1, 1)).heights(pads.layout))
data = mujoco.MjData(model)
mujoco.mj_step(model, data)
paxisim.TactileReadout(model, pads).read(data)
"""
    assert modules_after(code).isdisjoint(OPTIONAL)


def imported_from(path: Path) -> set[str]:
    """Return the parts of paxisim that a file imports, including imports in functions and for type checkers."""
    found = set()
    inside = (path.relative_to(PACKAGE) if path.is_relative_to(PACKAGE) else path).parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ["paxisim", *inside[: len(inside) - node.level]] if node.level else []
            module = ".".join([*base, *filter(None, [node.module])])
            # `from paxisim import viz` imports a part; `from paxisim import Pad` imports the top-level package
            names = [f"{module}.{alias.name}" for alias in node.names] if module == "paxisim" else [module]
        else:
            continue
        found |= {(name.split(".") + [""])[1] for name in names if name.split(".")[0] == "paxisim"}
    return found


FILES = sorted(
    p for p in PACKAGE.rglob("*.py") if p.relative_to(PACKAGE).as_posix() not in ("__init__.py", "_version.py")
)


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def test_the_files_are_found():
    assert {"errors", "layout", "sensors", "models", "viz", "cli"} <= {part_of(path) for path in FILES}
    assert imported_from(PACKAGE / "models" / "pad.py") == {"errors", "layout", "models"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_imports_run_one_way(path):
    part = part_of(path)
    assert part in LEVELS, f"{part} is missing in LEVELS"
    # the command line may import the top-level package, like any user of the library
    for other in imported_from(path) - ANYWHERE - {part} - ({""} if part == "cli" else set()):
        assert other in LEVELS, f"{path.name} imports paxisim.{other}: import from the part that defines it"
        assert LEVELS[other] < LEVELS[part], f"{part} must not import {other}"


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def modules_imported_by(path: Path, known: set[str], *, later: bool = False) -> set[str]:
    """Return the modules of paxisim that a file imports at runtime; with `later` also those in functions."""
    found, open_ = set(), [ast.parse(path.read_text(encoding="utf-8"))]
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
            assert not node.level, f"{path.name} has a relative import"
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            modules = names & known
            found |= modules | ({node.module} if len(modules) < len(names) else set())
    return found & known - {module_of(path)}


# __init__ files import their modules lazily; the modules do not import their package
MODULES = {module_of(path): path for path in FILES if path.name != "__init__.py"}
PACKAGES = {module_of(path) for path in FILES if path.name == "__init__.py"}


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


def test_circles_are_found():
    assert circle_in({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c"]
    assert circle_in({"a": {"b", "c"}, "b": {"c"}}) == []


# a class or function that calls, inside its methods, what is built on it: to load, save, run or report itself
FACADES = {
    "paxisim.augment.gcs": {"paxisim.augment.around"},
    "paxisim.diagnose.diagnosis": {"paxisim.diagnose.report.page"},
    "paxisim.hw.profile": {"paxisim.hw.profile_file"},
    "paxisim.protocols.protocol": {"paxisim.protocols.text"},
    "paxisim.scene.scene": {"paxisim.scene.changed", "paxisim.scene.replay", "paxisim.scene.rig", "paxisim.scene.toml"},
}


def test_no_module_needs_itself():
    """Imports in functions count, except those of a facade."""
    known = set(MODULES)
    imports = {
        name: modules_imported_by(path, known, later=True) - FACADES.get(name, set()) for name, path in MODULES.items()
    }
    assert circle_in(imports) == []


def test_no_facade_is_needed_to_be_imported():
    assert circle_in({name: modules_imported_by(path, set(MODULES)) for name, path in MODULES.items()}) == []


@pytest.mark.parametrize("name", sorted(n for n in MODULES if n.startswith("paxisim.diagnose.")))
def test_modules_of_the_diagnosis_do_not_reach_back_to_their_packages(name):
    imported = modules_imported_by(MODULES[name], PACKAGES | set(MODULES))
    assert not {package for package in PACKAGES & imported if name.startswith(f"{package}.")}


INTEGRATIONS = PACKAGE.parent / "integrations"


@pytest.mark.skipif(not INTEGRATIONS.exists(), reason="no integrations yet")
def test_integrations_see_only_the_public_names():
    for path in INTEGRATIONS.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
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
    assert circle_in({name: found & set(imports) for name, found in imports.items()}) == []
