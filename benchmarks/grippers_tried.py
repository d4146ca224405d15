"""Grippers tried: puts pads on every gripper, hand and arm found here and measures the load they carry; prints a table.

The models are those in the given files and folders, those that the installed robosuite, gymnasium_robotics and
gym_aloha bring, and those that mujoco_menagerie and robot_descriptions have in their caches. Nothing is downloaded.
A file counts as a model if MuJoCo loads it by itself and it has joints; a scene that includes another model is left
out. `grippers_tried.toml` says which models need an option of `attach` or mounts by hand.

    python benchmarks/grippers_tried.py [FILE OR FOLDER ...]
"""

from __future__ import annotations

import importlib.util
import os
import sys
import time
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import tyro
from lxml import etree

from paxisim import Pad, TaxelLayout, attach, plot_mounts, squeeze
from paxisim.cli.mounts import parse_mount
from paxisim.errors import PaxisimError
from paxisim.models.attach import TactileGripper
from paxisim.models.load import compile_whole, load_spec

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]

ROWS, COLS, PITCH = 4, 3, (4e-3, 4e-3)  # PITCH in m
OPTIONS = Path(__file__).with_suffix(".toml")
INSTALLED = {
    "robosuite": ("models/assets/grippers/*.xml",),
    # one scene of each robot
    "gymnasium_robotics": tuple(
        f"envs/assets/{scene}.xml" for scene in ("hand/reach", "adroit_hand/adroit_door", "fetch/pick_and_place")
    ),
    "gym_aloha": ("assets/bimanual_viperx_transfer_cube.xml",),
}


@dataclass(frozen=True)
class Row:
    """A row of the table.

    Attributes:
        gripper: Folder and name of the model's file.
        placed: How its pads were placed.
        pads: Number of pads.
        share: Smallest share of the load that its pads carry; None if it could not be measured.
        seconds: CPU time (s) of `attach`.
        notes: Why `attach` refused it, or what it warned of.
    """

    gripper: str
    placed: str
    pads: int
    share: float | None
    seconds: float
    notes: tuple[str, ...]

    def __str__(self) -> str:
        """Return the row in Markdown."""
        share = "-" if self.share is None else f"{self.share:.0%}"
        return f"| {self.gripper} | {self.placed} | {self.pads or '-'} | {share} | {self.seconds:.1f} |"


def share(tactile: TactileGripper) -> float | None:
    """Return the smallest share of the load that a pad carries when the gripper squeezes an object.

    None if no object could be squeezed.
    """
    return min(squeeze(tactile).shares.values(), default=None) if tactile.grips else None


def try_gripper(path: Path, pictures: Path) -> Row:
    """Put pads on a gripper, measure the share of the load they carry, and save a picture of it.

    Args:
        path: Its file.
        pictures: Folder for the picture.
    """
    name = "/".join(path.parts[-2:])
    pad = Pad(TaxelLayout(ROWS, COLS, PITCH))
    options = options_for(path)
    texts = options.pop("mounts", ())
    placed = "by hand" if texts else ", ".join(f"`--{key} {_words(value)}`" for key, value in options.items())
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        start = time.process_time()
        try:
            tactile = attach(path, pad, [parse_mount(text) for text in texts] or None, **options)
        except PaxisimError as error:
            return Row(name, "refused", 0, None, time.process_time() - start, (_line(error),))
        seconds = time.process_time() - start
        known = tactile.report.startswith(f"{path.name} is known")
        notes = [_line(warning.message) for warning in caught]
        try:
            carried = share(tactile)
        except PaxisimError as error:
            carried = None
            notes.append(f"not squeezed: {_line(error)}")
        pictures.mkdir(parents=True, exist_ok=True)
        plot_mounts(tactile).savefig(pictures / f"{name.replace('/', '_')}.png", dpi=100, bbox_inches="tight")
    placed = placed or ("known" if known else "by itself")
    return Row(name, placed, len(tactile.pad_names), carried, seconds, tuple(dict.fromkeys(notes)))


def options_for(path: Path) -> dict[str, Any]:
    """Return the options of `attach` for a file: the first entry of `grippers_tried.toml` that matches its path."""
    entries = tomllib.loads(OPTIONS.read_text(encoding="utf-8"))
    return next((dict(entry) for pattern, entry in entries.items() if path.match(pattern)), {})


def _words(value: str | list[str]) -> str:
    return value if isinstance(value, str) else " ".join(value)


def _line(message: object) -> str:
    return " ".join(str(message).split())


def installed() -> Iterator[Path]:
    """Yield the files that installed packages bring or have cached, without importing them."""
    for package, patterns in INSTALLED.items():
        spec = importlib.util.find_spec(package)
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            for pattern in patterns:
                yield from sorted(Path(folder).glob(pattern))
    cached = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    menagerie = os.environ.get("MENAGERIE_ROOT") or os.environ.get("MENAGERIE_CACHE_DIR") or cached / "mujoco_menagerie"
    descriptions = os.environ.get("ROBOT_DESCRIPTIONS_CACHE") or Path.home() / ".cache" / "robot_descriptions"
    for folder in (menagerie, descriptions):
        yield from files_in(Path(folder).expanduser())


def files_in(path: Path) -> list[Path]:
    """Return the MJCF and URDF files in a folder, or the file itself."""
    return [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.suffix in (".xml", ".urdf"))


def models(files: Iterable[Path]) -> list[Path]:
    """Return the files that are models, each once, without those that include another model."""
    files = list(dict.fromkeys(file.resolve() for file in files))
    return [f for f in files if _is_model(f) and not any(_is_model(included) for included in _included(f))]


def _included(file: Path) -> list[Path]:
    """Return the files that an MJCF file includes; their paths are relative to its folder."""
    return [(file.parent / element.get("file", "")).resolve() for element in etree.parse(file).iter("include")]


@cache
def _is_model(file: Path) -> bool:
    try:
        # an included file, or any other XML, has another root
        if etree.parse(file).getroot().tag not in ("mujoco", "robot"):
            return False
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # `attach` gives them again
            model = compile_whole(load_spec(file), "the model")
    except (OSError, PaxisimError, etree.XMLSyntaxError):
        return False
    return bool(model.njnt)


def main(
    paths: tyro.conf.Positional[tuple[Path, ...]] = (),
    only: str = "",
    pictures: Path = Path("grippers_tried"),
) -> None:
    """Print the table.

    Args:
        paths: More files, and folders to search for files.
        only: Try only models whose path contains this text.
        pictures: Folder for the pictures.
    """
    found = [file for path in paths for file in files_in(path)] + list(installed())
    tried = models(file for file in found if only in str(file))
    if not tried:
        sys.exit("no model found: give files or folders, or install robosuite")
    print("| gripper | pads placed | pads | smallest share of the load | CPU (s) |\n|---|---|---|---|---|")
    notes = []
    for path in tried:
        row = try_gripper(path, pictures)
        print(row, flush=True)
        notes += [f"- {row.gripper}: {note}" for note in row.notes]
    print("\n" + "\n".join(notes) if notes else "")


if __name__ == "__main__":
    tyro.cli(main)
