"""Expand xacro, ROS's macro language for robot models, without ROS and without running any code.

This is the part of the language that hand models are written in: includes, arguments, properties, conditions, and
macros with named parameters. Expressions are arithmetic on numbers, comparisons and a few functions; they are parsed
and evaluated here, never passed to Python. Anything else is refused, with the advice to run ROS's ``xacro`` first.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections import ChainMap
from collections.abc import Callable, Iterator, MutableMapping
from pathlib import Path
from typing import Any

from lxml import etree

from paxisim.errors import InvalidValueError

MAX_ELEMENTS = 100_000
"""Largest number of elements and instructions to expand; the covered hands of 2026 have about 5,000."""
MAX_DEPTH = 100
"""Largest depth of includes and macros inside one another."""

_FUNCTIONS: dict[str, Callable[..., float]] = {
    name: getattr(math, name)
    for name in ("radians", "degrees", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sqrt")
} | {"abs": abs}
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_SUBSTITUTION = re.compile(r"\$\{([^{}]*)\}|\$\(([^()]*)\)")
_PARAMETER = re.compile(r"([^\s:=]+)(?::?=('[^']*'|\S*))?(?:\s+|$)")
_Scope = MutableMapping[str, Any]


def read_robot(path: str | Path) -> etree._Element:
    """Read a robot model from a URDF or xacro file and return its ``<robot>`` element with all macros expanded.

    ``$(find PACKAGE)`` is the nearest folder above the file that has the package's name or whose ``package.xml`` does.

    Raises:
        InvalidValueError: The file cannot be read, is not a robot model, or uses more of xacro than this module knows.
    """
    path = Path(path)
    robot = _parse(path)
    if robot.tag != "robot":
        raise InvalidValueError(f"{path} is not a robot model: expected the element <robot>, got <{robot.tag}>")
    expanded = etree.Element("robot", name=robot.get("name", ""))
    reader = _Reader(path)
    try:
        expanded.extend(reader.children(robot, ChainMap({"pi": math.pi, "True": True, "False": False})))
    except RecursionError:
        raise reader.refusal("its expressions or macros are too deep") from None
    return expanded


class _Reader:
    """The state of one expansion: the files being read, the macros and the arguments."""

    def __init__(self, path: Path) -> None:
        self.files = [path]
        self.macros: dict[str, tuple[list[tuple[str, str | None]], etree._Element]] = {}
        self.arguments: dict[str, str] = {}
        self.elements = self.depth = 0

    def refusal(self, why: str) -> InvalidValueError:
        file = self.files[-1]
        return InvalidValueError(
            f"cannot read {file}: {why}; expand the model with ROS (xacro {self.files[0].name} > hand.urdf) and pass "
            "the URDF"
        )

    def children(self, parent: etree._Element, scope: _Scope) -> Iterator[etree._Element]:
        """Expand the children of an element."""
        for child in parent.iterchildren(etree.Element):
            self.elements += 1
            if self.elements > MAX_ELEMENTS:
                raise self.refusal(f"it has more than {MAX_ELEMENTS} elements")
            name = etree.QName(child)
            if (name.namespace or "").rstrip("/").endswith("xacro"):
                yield from self._instruction(child, name.localname, scope)
                continue
            attributes = {str(key): _text(self.value(str(text), scope)) for key, text in child.attrib.items()}
            made = etree.Element(child.tag, attributes)
            made.extend(self.children(child, scope))
            yield made

    def _instruction(self, node: etree._Element, name: str, scope: _Scope) -> Iterator[etree._Element]:
        if name in ("if", "unless"):
            if self._is_true(self._need(node, "value"), scope) == (name == "if"):
                yield from self.children(node, scope)
        elif name == "include" and set(node.attrib) == {"filename"}:
            yield from self._include(_text(self.value(self._need(node, "filename"), scope)), scope)
        elif name == "arg":
            default = _text(self.value(node.get("default", ""), scope))
            self.arguments.setdefault(self._need(node, "name"), default)
        elif name == "property" and set(node.attrib) == {"name", "value"}:
            scope[self._need(node, "name")] = self.value(self._need(node, "value"), scope)
        elif name == "macro":
            self._define(node)
        elif name in self.macros:
            yield from self._call(node, name, scope)
        else:
            with_ = "".join(f" {key}" for key in node.attrib)
            raise self.refusal(f"line {node.sourceline}: no macro or known instruction <xacro:{name}{with_}>")

    def _include(self, filename: str, scope: _Scope) -> Iterator[etree._Element]:
        path = self.files[-1].parent / filename
        self._deeper()
        root = _parse(path)
        self.files.append(path)
        yield from self.children(root, scope)
        self.files.pop()
        self.depth -= 1

    def _define(self, node: etree._Element) -> None:
        text = node.get("params", "").strip()
        parameters, end = [], 0
        for match in _PARAMETER.finditer(text):
            parameters.append((match[1], match[2]))
            end = match.end()
        if end < len(text) or any(key.startswith("*") or (value or "").startswith("^") for key, value in parameters):
            raise self.refusal(f"line {node.sourceline}: macro parameters of a kind not known here: {text!r:.80}")
        name = self._need(node, "name")
        self.macros[name.removeprefix("xacro:")] = (parameters, node)

    def _call(self, node: etree._Element, name: str, scope: _Scope) -> Iterator[etree._Element]:
        parameters, macro = self.macros[name]
        given = {str(key): self.value(str(text), scope) for key, text in node.attrib.items()}
        # a macro sees the names of its caller, and what it defines ends with it
        local: _Scope = ChainMap({}, scope)  # type: ignore[arg-type]
        for key, default in parameters:
            if key not in given and default is None:
                raise self.refusal(f"line {node.sourceline}: macro {name!r} needs the parameter {key!r}")
            local[key] = given.pop(key) if key in given else self.value(default or "", local)
        if given:
            raise self.refusal(f"line {node.sourceline}: macro {name!r} has no parameter {next(iter(given))!r}")
        self._deeper()
        yield from self.children(macro, local)
        self.depth -= 1

    def _deeper(self) -> None:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self.refusal(f"its files or macros call one another more than {MAX_DEPTH} deep")

    def _need(self, node: etree._Element, key: str) -> str:
        value = node.get(key)
        if value is None:
            raise self.refusal(f"line {node.sourceline}: <{node.tag}> needs the attribute {key!r}")
        return value

    def _is_true(self, text: str, scope: _Scope) -> bool:
        value = _literal(_text(self.value(text, scope)))
        if isinstance(value, str):
            raise self.refusal(f"the condition {text!r} is neither true nor false")
        return bool(value)

    def value(self, text: str, scope: _Scope) -> Any:
        """Evaluate a text with ``${expression}``, ``$(arg NAME)`` and ``$(find PACKAGE)``."""
        whole = _SUBSTITUTION.fullmatch(text)
        if whole is not None:
            return self._substitute(whole, scope)
        result = _SUBSTITUTION.sub(lambda match: _text(self._substitute(match, scope)), text)
        if "${" in _SUBSTITUTION.sub("", text) or "$(" in _SUBSTITUTION.sub("", text):
            raise self.refusal(f"the text {text!r:.80} is not known here")
        return result

    def _substitute(self, match: re.Match[str], scope: _Scope) -> Any:
        if match[1] is not None:
            return self._expression(match[1], scope)
        kind, _, name = match[2].strip().partition(" ")
        if kind == "arg" and name in self.arguments:
            return self.arguments[name]
        if kind == "find":
            return str(self._package(name))
        raise self.refusal(f"{match[0]!r} is not known here")

    def _package(self, name: str) -> Path:
        for folder in self.files[-1].resolve().parents:
            manifest = folder / "package.xml"
            if folder.name == name or (manifest.is_file() and _parse(manifest).findtext("name", "").strip() == name):
                return folder
        raise self.refusal(f"no folder above it is the package {name!r}")

    def _expression(self, text: str, scope: _Scope) -> Any:
        try:
            return self._evaluate(ast.parse(text.strip(), mode="eval").body, scope)
        except (SyntaxError, ValueError, TypeError, ArithmeticError) as error:
            if isinstance(error, InvalidValueError):
                raise
            raise self.refusal(f"the expression ${{{text}}} cannot be evaluated ({error})") from None

    def _evaluate(self, node: ast.expr, scope: _Scope) -> Any:
        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float, str)):
            return node.value
        if isinstance(node, ast.Name):
            if node.id not in scope:
                raise self.refusal(f"nothing defines {node.id!r}")
            return _literal(scope[node.id])
        if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
            return _OPERATORS[type(node.op)](self._evaluate(node.operand, scope))
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            sides = [self._evaluate(side, scope) for side in (node.left, node.right)]
            if all(isinstance(side, (int, float)) for side in sides):
                return _OPERATORS[type(node.op)](*sides)
        if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _OPERATORS:
            return _OPERATORS[type(node.ops[0])](
                self._evaluate(node.left, scope), self._evaluate(node.comparators[0], scope)
            )
        if isinstance(node, ast.BoolOp):
            values = [self._evaluate(value, scope) for value in node.values]
            return all(values) if isinstance(node.op, ast.And) else any(values)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            function = _FUNCTIONS.get(node.func.id)
            if function is not None:
                return function(*(self._evaluate(argument, scope) for argument in node.args))
        raise self.refusal(f"the expression {ast.unparse(node)!r:.80} is more than arithmetic")


def _literal(value: Any) -> Any:
    """Return a text that is a number, a truth value or quoted as what it means, and anything else as it is."""
    if not isinstance(value, str):
        return value
    if len(value) >= 2 and value[0] == value[-1] == "'":
        return value[1:-1]
    if "_" in value:  # Python would read 1_0 as 10
        return value
    for convert in (int, float, {"true": True, "false": False, "True": True, "False": False}.__getitem__):
        try:
            return convert(value)
        except (ValueError, KeyError):
            continue
    return value


def _text(value: Any) -> str:
    return value[1:-1] if isinstance(value, str) and len(value) >= 2 and value[0] == value[-1] == "'" else str(value)


def _parse(path: Path) -> etree._Element:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        return etree.parse(str(path), parser).getroot()
    except (OSError, etree.XMLSyntaxError) as error:
        raise InvalidValueError(f"cannot read {path}: {' '.join(str(error).split())}") from error
