"""Members of an HDF5 file: those that refer to other files are refused, and those that claim more than is stored."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError


def member(path: Path, group: Any, name: str) -> Any:
    """Return a group or dataset of the file itself, or None if there is none of this name.

    Raises:
        InvalidValueError: It is in another file, which may be any file that the user can read.
    """
    link = group.get(name, getlink=True)
    if link is None:
        return None
    found = None if hasattr(link, "filename") else group[name]
    elsewhere = getattr(found, "external", None) or getattr(found, "is_virtual", False)
    if found is None or elsewhere or found.file != group.file:
        place = f"{group.name.rstrip('/')}/{name}"
        raise InvalidValueError(
            f"{path}: {place[1:]} is not in this file but refers to another one, which may be any file of yours: copy "
            "its values into the file"
        )
    return found


def most_values(dataset: Any) -> int:
    """Return how many values a dataset may have; those that are not stored would read as zeros."""
    return dataset.id.get_storage_size() * 1024


def numbers(place: str, name: str, dataset: Any) -> NDArray[np.float64]:
    """Return the values of a dataset.

    Args:
        place: File and group, for messages.
        name: Name of the dataset, for messages.
        dataset: The dataset.

    Raises:
        InvalidValueError: It has more values than the file stores.
    """
    if dataset.size > most_values(dataset):
        raise InvalidValueError(f"{place}: {name} has shape {dataset.shape}, but its values are not stored")
    return np.asarray(dataset[()], dtype=np.float64)
