"""Help and error texts: the help of a command with its examples at the end, and errors as sentences."""

from __future__ import annotations

import errno
import os
import re
import shutil
import textwrap
from collections.abc import Collection, Mapping, Sequence

from paxisim.errors import UnknownNameError

_EXAMPLES = "For example:"
_BOXES = (" positional arguments", " options", " subcommands")  # headings after the description in tyro's help


def arranged(text: str) -> str:
    """Fit the help of a command to the terminal's width, with the examples of its description at the end.

    Args:
        text: Help as tyro prints it; tyro wraps its boxes, but not the description.
    """
    width = shutil.get_terminal_size().columns
    lines = _without_none(text).rstrip().splitlines() or [""]
    examples: list[str] = []
    if _EXAMPLES in lines:
        begin = lines.index(_EXAMPLES)
        end = next((i for i in range(begin, len(lines)) if lines[i].startswith(_BOXES)), len(lines))
        examples = [line for line in lines[begin + 1 : end] if line]
        lines = lines[:begin] + lines[end:]
    wrapped = [textwrap.fill(line, width) if len(line) > width else line for line in lines]
    if examples:
        wrapped += ["", "Example:" if len(examples) == 1 else "Examples:"]
        wrapped += [_command(line, width) for line in examples]
    return "\n".join(wrapped)


def _without_none(text: str) -> str:
    """Drop Python's None and empty defaults from tyro's help: to a reader these are options without a default."""
    text = re.sub(r"\s*\(default:\s+(None|''|)\)", "", text)
    text = re.sub(r"^( .*)\{None\}\|([^\s\]]+\]?)(?=  )", r"\1\2       ", text, flags=re.MULTILINE)
    return text.replace("{None}|", "").replace("{None,", "{")


def _command(line: str, width: int) -> str:
    """Indent an example and break it before its options, with backslashes, so that it can be pasted."""
    lines = [""]
    for part in re.split(r" (?=-\w|--)", line):
        if lines[-1] and len(lines[-1]) + len(part) > width - 10:
            lines.append("")
        lines[-1] += f" {part}" if lines[-1] else part
    return " \\\n    ".join(lines).join(["  ", ""])


def overview(sections: Mapping[str, Sequence[str]], sentences: Mapping[str, str]) -> str:
    """Return the list of verbs.

    Args:
        sections: Verbs by heading.
        sentences: What each verb does.
    """
    width, column = min(shutil.get_terminal_size().columns, 80), 4 + max(map(len, sentences))
    lines = ["usage: paxisim VERB ...", "", "Magnet-based tactile sensors in MuJoCo."]
    for heading, verbs in sections.items():
        lines += ["", f"{heading}:"]
        for verb in verbs:
            begin = f"  {verb}".ljust(column)
            lines += textwrap.wrap(" ".join(sentences[verb].split()), width, initial_indent=begin,
                                   subsequent_indent=" " * column)  # fmt: skip
    return "\n".join([*lines, "", "`paxisim VERB --help` explains a verb, `paxisim --version` prints the version."])


def unknown_verb(words: Sequence[str], verbs: Mapping[str, Collection[str]]) -> str:
    """Return an error about words that begin with no verb; empty if they do.

    Args:
        words: Arguments after ``paxisim``.
        verbs: Known verbs, each with the verbs that may follow it.
    """
    if not words or words[0].startswith("-"):
        return ""
    if words[0] not in verbs:
        return f"{UnknownNameError('verb', words[0], verbs)}; see paxisim --help"
    following = verbs[words[0]]
    if following and len(words) > 1 and not words[1].startswith("-") and words[1] not in following:
        return f"{UnknownNameError(f'verb of {words[0]}', words[1], following)}; see paxisim {words[0]} --help"
    return ""


def misuse(boxed: str, words: Sequence[str], verbs: Mapping[str, Collection[str]]) -> str:
    """Return why the arguments did not parse, and which help to read.

    Args:
        boxed: Message of tyro, in a box.
        words: Arguments after ``paxisim``.
        verbs: Known verbs, each with the verbs that may follow it.
    """
    paragraphs: list[list[str]] = [[]]
    for line in boxed.splitlines()[1:]:
        text = line.strip("│╭╮╰╯ \n")
        if text.startswith(("For full helptext", "Got errors")):
            break
        if text.strip("─- "):
            paragraphs[-1] += text.split()
        elif paragraphs[-1]:
            paragraphs.append([])
    said = [_plainly(" ".join(words)) for words in paragraphs if words]
    asked = ["paxisim"]
    if words and words[0] in verbs:
        asked.append(words[0])
        asked += [word for word in words[1:2] if word in verbs[words[0]]]
    return f"{'; '.join(filter(None, said))}; see {' '.join(asked)} --help"


def _plainly(said: str) -> str:
    """Return a paragraph of tyro's message as a user would say it; empty if it only repeats the help."""
    if said.startswith("Argument helptext:"):
        return ""
    if found := re.match(r"Error parsing (\S+): .*?(INT|FLOAT|int\(|float)[^']*('.*')", said):
        option, kind, got = found.groups()
        return f"{option} must be a {'whole ' if kind.lower().startswith('int') else ''}number, got {got}"
    if found := re.match(r"invalid choice ('.*') for argument '(.*)'. Expected one of \((.*)\)", said):
        got, option, choices = found.groups()
        return f"{option} must be one of {choices.rstrip(',')}, got {got}"
    if found := re.match(r"Missing value for argument '(.*)'", said):
        return f"{found[1]} needs a value"
    if found := re.match(r"Missing from paxisim[\w ]*: (.*)", said):
        parts = (part.strip().rstrip(".") for part in found[1].split("(required)") if part.strip())
        return "missing: " + ", ".join(re.sub(r"^(--\S+ )?(\S+) (.*)$", r"\1\2 (\3)", part) for part in parts)
    if found := re.match(r"Unrecognized options: (.*)", said):
        return f"unknown option {found[1]}"
    if found := re.match(r"Perhaps you meant: (\S+)", said):
        return f"did you mean {found[1]}?"
    return said.removesuffix(".")


def sentence(error: OSError) -> str:
    """Return the operating system's error about a file as a sentence."""
    if error.errno is None:
        return str(error)
    what = "no such file or folder" if error.errno == errno.ENOENT else os.strerror(error.errno).lower()
    names = [os.fspath(name) for name in (error.filename, error.filename2) if isinstance(name, (str, os.PathLike))]
    return f"{what}: {' -> '.join(names)}" if names else what
