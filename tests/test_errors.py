"""Errors: they can be caught as paxisim's or as the matching builtin, and have helpful messages."""

import copy
import pickle

import pytest

from paxisim import errors


@pytest.mark.parametrize(
    ("error", "builtin"),
    [
        (errors.InvalidValueError, ValueError),
        (errors.UnknownNameError, LookupError),
        (errors.MissingExtraError, ImportError),
        (errors.OutputExistsError, FileExistsError),
        (errors.UnsupportedError, RuntimeError),
        (errors.DeviceError, OSError),
        (errors.DeviceTimeoutError, TimeoutError),
        (errors.PortNotFoundError, FileNotFoundError),
        (errors.PortAccessError, PermissionError),
        (errors.ProtocolError, OSError),
    ],
)
def test_every_error_is_also_the_builtin_that_fits(error, builtin):
    assert issubclass(error, errors.PaxisimError)
    assert issubclass(error, builtin)


def test_every_error_of_the_module_is_a_paxisim_error():
    classes = [c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, Exception)]
    assert len(classes) == 11
    assert all(issubclass(c, errors.PaxisimError) for c in classes)


@pytest.mark.parametrize(
    "error",
    [
        errors.UnknownNameError("body", "lft", ["left", "right"]),
        errors.MissingExtraError("matplotlib", "viz", "plot_tactile"),
        errors.InvalidValueError("what came"),
        errors.PortNotFoundError("there is no such port"),
    ],
)
def test_errors_survive_the_way_back_from_another_process(error):
    for again in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert type(again) is type(error)
        assert str(again) == str(error)


@pytest.mark.parametrize(
    ("name", "known", "message"),
    [
        ("lft", ["left", "right"], "unknown body 'lft'; did you mean 'left'?"),
        ("finger", ["finger2", "finger1"], "unknown body 'finger'; did you mean 'finger2' or 'finger1'?"),
        ("PALM", ["palm", "wrist"], "unknown body 'PALM'; did you mean 'palm'?"),
        ("palm", ["PALM", "WRIST"], "unknown body 'palm'; did you mean 'PALM'?"),
        ("xyz", ["right", "left"], "unknown body 'xyz'; known: left, right"),
        ("left", [], "unknown body 'left'; there is none"),
        ("left", (n for n in ["lefty"]), "unknown body 'left'; did you mean 'lefty'?"),
    ],
)
def test_unknown_names_come_with_the_near_ones(name, known, message):
    error = errors.UnknownNameError("body", name, known)
    assert sorted(str(error).split()) == sorted(message.split()), "the similar names may come in any order"


def test_at_most_three_near_names():
    error = errors.UnknownNameError("geom", "tip", [f"tip{i}" for i in range(9)])
    assert str(error).count(" or ") == 2


def test_a_missing_extra_says_how_to_install_it():
    error = errors.MissingExtraError("matplotlib", "viz", "plot_tactile")
    assert str(error) == "plot_tactile needs matplotlib, which is not installed: pip install 'paxisim[viz]'"
