"""Read YAML text into plain data, and remember the line and column of each value."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, ReusedAnchorWarning
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from mdr_dask.campaign.problems import Path, Place, Problems, dotted
from mdr_dask.errors import CampaignError

_TAG = "tag:yaml.org,2002:"
#: Largest number of characters in a file, of values in a file (with aliases, a short text can stand for billions of
#: values), and of values on an axis. Chosen by trial: reading so many characters takes about 20 s.
LARGEST = 10**6
TOO_DEEP = "too deeply nested, too many values, or an alias that contains itself"
_KEPT_AS_TEXT = ("str", "timestamp", "merge", "value")


@dataclass
class Document:
    """The data of a YAML file, and the YAML nodes from which the data were read."""

    # Path and text of the file.
    source: str
    text: str
    # Mappings, lists, texts, numbers, truth values and None.
    data: Any = None
    problems: Problems = field(default_factory=Problems)
    _nodes: dict[Path, Node] = field(default_factory=dict)
    _keys: dict[Path, Node] = field(default_factory=dict)

    def place(self, path: Path) -> Place:
        """Return the position of the value at a path, or of the mapping or list around a missing value."""
        while path not in self._nodes and path:
            path = path[:-1]
        return self._at(self._nodes[path]) if path in self._nodes else Place(self.source, 1, 1)

    def key_place(self, path: Path) -> Place:
        """Return the position of the key at a path. For an entry of a list, return the position of the entry."""
        return self._at(self._keys[path]) if path in self._keys else self.place(path)

    def last(self) -> Place:
        """Return the position of the last value that was read."""
        return self._at([*self._nodes.values()][-1]) if self._nodes else Place(self.source, 1, 1)

    def report(self, path: Path, what: str, key: bool = False) -> None:
        """Add a problem of the value at a path or, if `key` is true, of the key at this path."""
        self.problems.add(self.key_place(path) if key else self.place(path), dotted(path), what)

    def flow(self, path: Path) -> str:
        """Return the value at a path as YAML on one line, with numbers and texts as in the file."""
        return _flow(self._nodes[path])

    def _at(self, node: Node) -> Place:
        return Place(self.source, node.start_mark.line + 1, node.start_mark.column + 1)


def read_text(path: str | FilePath) -> str:
    """Return the text of a YAML file. Raise CampaignError if the file cannot be read or is not UTF-8."""
    try:
        return FilePath(path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CampaignError(f"{path}:1:1: expected UTF-8 text, got byte {error.object[error.start]:#x}") from None
    except OSError as error:
        raise CampaignError(f"{path}: cannot be read: {error.strerror}") from None


def parse(text: str, source: str) -> Document:
    """Parse a YAML 1.2 text. `source` is the name of the text in messages, for example the name of a file.

    Errors in the text are not raised, but added to `problems` of the returned document.
    """
    document = Document(source, text)
    problems = document.problems
    if len(text) > LARGEST:
        what = (
            f"expected at most {LARGEST} characters, got {len(text)} (write many values as a range, or put "
            "them into a table)"
        )
        problems.add(Place(source, 1, 1), "", what)
        return document
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ReusedAnchorWarning)
            root = YAML(typ="safe", pure=True).compose(text)
        if root is not None:
            document.data = _Reader(document).read(root, ())
    except RecursionError:
        problems.add(document.last(), "", TOO_DEEP)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        what = ", ".join(part for part in (error.context, error.problem) if part)
        problems.add(Place(source, mark.line + 1, mark.column + 1), "", f"not YAML: {what}{_hint(text, mark.index)}")
    except ReaderError as error:
        before = text[: error.position]
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        problems.add(Place(source, line, column), "", f"not YAML: {str(error).splitlines()[0]}")
    return document


_NO_TEXT = re.compile("[\0\ud800-\udfff]")
_NO_BLANK = re.compile(r"(?:^|[{,])\s*(?:- )?([A-Za-z_]\w*):(?=[^\s:/\\])")
_COLON_WITHIN = re.compile(r"\s*(?:- )?\w+: +[^\s'\"{\[#][^#]*: ")


def _hint(text: str, index: int) -> str:
    """Return a hint on the likely mistake at or just above the position of a syntax error, or an empty text."""
    if text[index : index + 1] == "\t":
        return " (indent with spaces, not with tabs)"
    end = text.find("\n", index)
    above = text[: end if end >= 0 else len(text)].splitlines()
    for back, line in enumerate(reversed(above[-3:])):
        found = _NO_BLANK.search(line)
        if found:
            return f" (a space is missing after '{found[1]}:' in line {len(above) - back})"
    if text[index : index + 1] == "*":
        return " (put quotation marks around a string that begins with *)"
    if _COLON_WITHIN.match(above[-1] if above else ""):
        return " (put quotation marks around a string with a colon and a space in it)"
    return " (all entries of a mapping must begin in the same column)" if _is_indented_otherwise(above) else ""


def _is_indented_otherwise(lines: list[str]) -> bool:
    written = [line for line in lines if line.strip() and not line.lstrip().startswith("#")][-2:]
    if len(written) < 2 or written[0].rstrip().endswith(":"):
        return False
    first, second = (len(line) - len(line.lstrip()) for line in written)
    return second != first and second > 0


class _Reader:
    def __init__(self, document: Document) -> None:
        self.document = document
        self.problems = document.problems

    def read(self, node: Node, path: Path) -> Any:
        """Return the plain data of a node and remember its position."""
        if len(self.document._nodes) > LARGEST:
            raise RecursionError
        self.document._nodes[path] = node
        if isinstance(node, MappingNode):
            return self._mapping(node, path)
        if isinstance(node, SequenceNode):
            return [self.read(item, (*path, index)) for index, item in enumerate(node.value)]
        assert isinstance(node, ScalarNode)
        return self._scalar(node, path)

    def _mapping(self, node: MappingNode, path: Path) -> dict[str, Any]:
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = key_node.value if isinstance(key_node, ScalarNode) else "?"
            place = self.document._at(key_node)
            if key_node.tag not in (_TAG + "str", _TAG + "merge") or _NO_TEXT.search(key):
                self.problems.add(place, dotted((*path, key)), "expected a text as key (put it in quotation marks)")
            elif key in data:
                first = self.document.key_place((*path, key)).line
                self.problems.add(place, dotted((*path, key)), f"this key was already given in line {first}")
            else:
                self.document._keys[(*path, key)] = key_node
                data[key] = self.read(value_node, (*path, key))
        return data

    def _scalar(self, node: ScalarNode, path: Path) -> Any:
        kind = str(node.tag).removeprefix(_TAG)
        text: str = node.value
        if kind == "null":
            return None
        if kind == "bool":
            return text.casefold() == "true"
        if _NO_TEXT.search(text):
            self.document.report(path, "expected text without null characters or half characters (surrogates)")
            return None
        digits = text.replace("_", "").casefold()
        if kind == "int":
            try:
                whole = int(digits, 0 if digits.lstrip("+-")[:2] in ("0x", "0o", "0b") else 10)
                float(whole)
            except (ValueError, OverflowError):
                self.document.report(path, f"expected a shorter number, got {len(text)} digits")
                return None
            return whole
        if kind == "float":
            return float(digits.replace(".inf", "inf").replace(".nan", "nan"))
        if kind not in _KEPT_AS_TEXT:
            self.document.report(path, f"unknown tag {str(node.tag)!r}")
        return text


def _flow(node: Node) -> str:
    if isinstance(node, MappingNode):
        return "{" + ", ".join(f"{_flow(key)}: {_flow(value)}" for key, value in node.value) + "}"
    if isinstance(node, SequenceNode):
        return "[" + ", ".join(_flow(item) for item in node.value) + "]"
    return str(node.value) or "null"
