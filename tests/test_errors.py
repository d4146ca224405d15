"""Errors: they can be caught as paxisim's or as the matching builtin, and have helpful messages."""

import copy
import pickle

import pytest

from paxisim import errors

BUILTINS = {
    errors.InvalidValueError: ValueError,
    errors.UnknownNameError: LookupError,
    errors.MissingExtraError: ImportError,
    errors.OutputExistsError: FileExistsError,
    errors.UnsupportedError: RuntimeError,
    errors.DeviceError: OSError,
    errors.DeviceTimeoutError: TimeoutError,
    errors.PortNotFoundError: FileNotFoundError,
    errors.PortAccessError: PermissionError,
    errors.ProtocolError: OSError,
}


def test_every_error_is_paxisim_s_and_the_builtin_that_fits():
    classes = {c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, Exception)}
    assert classes == {*BUILTINS, errors.PaxisimError}
    for error, builtin in BUILTINS.items():
        assert issubclass(error, errors.PaxisimError), error
        assert issubclass(error, builtin), error


@pytest.mark.parametrize(
    ("name", "known", "message"),
    [
        ("lft", ["left", "right"], "unknown body 'lft'; did you mean 'left'?"),
        ("finger", ["finger2", "finger1"], "unknown body 'finger'; did you mean 'finger2' or 'finger1'?"),
        ("palm", ["PALM", "WRIST"], "unknown body 'palm'; did you mean 'PALM'?"),
        ("xyz", ["right", "left"], "unknown body 'xyz'; known: left, right"),
        ("rogth", ["right", "left"], "unknown body 'rogth'; did you mean 'right'?"),
        ("robots", ["surrogates", "pads"], "unknown body 'robots'; known: pads, surrogates"),
        ("uspa", ["xela-uspa44", "pad"], "unknown body 'uspa'; did you mean 'xela-uspa44'?"),
        (
            "x",
            map(str, range(30)),
            f"unknown body 'x'; known: {', '.join(sorted(map(str, range(30)))[:20])} and 10 more",
        ),
        ("left", [], "unknown body 'left'; there is none"),
        ("left", (n for n in ["lefty"]), "unknown body 'left'; did you mean 'lefty'?"),
    ],
)
def test_unknown_names_come_with_the_near_ones_and_survive_another_process(name, known, message):
    error = errors.UnknownNameError("body", name, known)
    assert sorted(str(error).split()) == sorted(message.split()), "the similar names may come in any order"
    for again in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert (type(again), str(again)) == (type(error), str(error))
    assert str(error.advised("look there")) == f"{error}; look there"


def test_at_most_three_near_names():
    error = errors.UnknownNameError("geom", "tip", [f"tip{i}" for i in range(9)])
    assert str(error).count(" or ") == 2


def test_a_missing_extra_says_how_to_install_it_also_from_another_process():
    error = errors.MissingExtraError("matplotlib", "viz", "plot_tactile")
    assert str(error) == "plot_tactile needs matplotlib, which is not installed: pip install 'paxisim[viz]'"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
