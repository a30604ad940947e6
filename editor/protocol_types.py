"""Writes src/protocol/types.ts, the protocol as TypeScript, from the Structs that the server itself decodes with.

`python editor/protocol_types.py` writes; with `--check` it only tells, by its exit status, whether the file is as it
would be written.
"""

import enum
import inspect
import json
import sys
import types
import typing
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import UnsetType

from arcor2_hw.data.events import EVENTS, ChangeType
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS

TARGET: Final = Path(__file__).resolve().parent / "src" / "protocol" / "types.ts"
HEAD: Final = """/**
 * The protocol's data, requests and events. Made by editor/protocol_types.py from arcor2_hw.data: do not edit.
 *
 * A field with `?` may be left out. Lengths are in m, angles in rad, quaternions x, y, z, w.
 */
"""
_SCALARS: Final[dict[Any, str]] = {
    str: "string",
    int: "number",
    float: "number",
    bool: "boolean",
    Any: "unknown",
    type(None): "null",
    msgspec.Raw: "unknown",
}


class Writer:
    """Collects the types that are reached, each once."""

    def __init__(self) -> None:
        self.declared: dict[str, str] = {}
        self.answered: set[type] = set()
        """Structs that the server sends, where fields with a default are always there."""

    def reach(self, kind: Any) -> None:
        """Note the Structs in what the server sends."""
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
            if kind in self.answered:
                return
            self.answered.add(kind)
            for field in msgspec.structs.fields(kind):
                self.reach(field.type)
        for argument in typing.get_args(kind):
            self.reach(argument)

    def name(self, kind: Any) -> str:
        """Give the TypeScript for a hint, declaring what it names."""
        if kind is None or kind in _SCALARS:
            return "null" if kind is None else _SCALARS[kind]
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if origin is typing.Annotated:
            return self.name(arguments[0])
        if origin in (typing.Union, types.UnionType):
            return " | ".join(dict.fromkeys(self.name(one) for one in arguments if one is not UnsetType))
        if origin is typing.Literal:
            return " | ".join(json.dumps(one) for one in arguments)
        if origin in (list, set, frozenset) or (origin is tuple and arguments[1:] == (...,)):
            inner = self.name(arguments[0])
            return f"({inner})[]" if "|" in inner else f"{inner}[]"
        if origin is tuple:
            return f"[{', '.join(self.name(one) for one in arguments)}]"
        if origin is dict:
            return f"Record<string, {self.name(arguments[1])}>"
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            if kind.__name__ not in self.declared:
                values = " | ".join(json.dumps(one.value) for one in kind)
                self.declared[kind.__name__] = f"{_comment(kind)}export type {kind.__name__} = {values};\n"
            return kind.__name__
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
            self._struct(kind)
            return kind.__name__
        raise TypeError(f"no TypeScript for {kind!r}")

    def _struct(self, kind: type[msgspec.Struct]) -> None:
        if kind.__name__ in self.declared:
            return
        self.declared[kind.__name__] = ""  # it may name itself
        lines = []
        for field in msgspec.structs.fields(kind):
            unset = UnsetType in typing.get_args(field.type) or field.type is UnsetType
            optional = unset or (not field.required and kind not in self.answered)
            lines.append(f"  {field.encode_name}{'?' if optional else ''}: {self.name(field.type)};\n")
        self.declared[kind.__name__] = f"{_comment(kind)}export interface {kind.__name__} {{\n{''.join(lines)}}}\n"


def _comment(kind: type) -> str:
    text = inspect.cleandoc(kind.__doc__ or "").replace("*/", "* /")
    if not text or text.startswith(f"{kind.__name__}("):
        return ""
    lines = text.splitlines()
    if len(lines) == 1:
        return f"/** {lines[0]} */\n"
    return "/**\n" + "".join(f" * {each}".rstrip() + "\n" for each in lines) + " */\n"


def typescript() -> str:
    """Give the text of the file."""
    writer = Writer()
    for rpc in RPCS.values():
        writer.reach(rpc.data)
    for event in EVENTS.values():
        writer.reach(event.data)
    requests, facts = [], []
    for name, rpc in sorted(RPCS.items()):
        args = "undefined" if rpc.args is None else writer.name(rpc.args)
        if rpc.args is not None and rpc.args_optional:
            args += " | undefined"
        data = "undefined" if rpc.data is None else writer.name(rpc.data)
        requests.append(f"  {name}: {{ args: {args}; data: {data} }};\n")
        facts.append(f"  {name}: {int(rpc.role)},\n")
    events = [
        f"  {name}: {'undefined' if event.data is None else writer.name(event.data)};\n"
        for name, event in sorted(EVENTS.items())
    ]
    additional = [f'  "{name}",\n' for name, event in sorted(EVENTS.items()) if event.additional]
    change = writer.name(ChangeType)
    declared = "\n".join(text for _, text in sorted(writer.declared.items()))
    roles = "".join(f"  {role.name.lower()}: {int(role)},\n" for role in Role)
    return (
        f"{HEAD}\n{declared}\n"
        f"/** Arguments and answer of each request. */\nexport interface Requests {{\n{''.join(requests)}}}\n\n"
        f"/** The data of each event. */\nexport interface Events {{\n{''.join(events)}}}\n\n"
        "/** An event as it comes. */\n"
        "export type ServerEvent = {\n  [Name in keyof Events]: {\n    event: Name;\n    data: Events[Name];\n"
        f"    change_type?: {change};\n    parent_id?: string;\n  }};\n}}[keyof Events];\n\n"
        "/** Roles, each of which may do what the ones before may. */\n"
        f"export const ROLES = {{\n{roles}}} as const;\n\n"
        "/** The least role of each request. */\n"
        f"export const LEAST_ROLE: Record<keyof Requests, number> = {{\n{''.join(facts)}}};\n\n"
        "/** Events beside the protocol, sent to who subscribed. */\n"
        f"export const ADDITIONAL_EVENTS = [\n{''.join(additional)}] as const satisfies (keyof Events)[];\n"
    )


def main() -> int:
    """Write or check the file; gives the exit status."""
    text = typescript()
    if sys.argv[1:] == ["--check"]:
        if TARGET.is_file() and TARGET.read_text() == text:
            return 0
        sys.stderr.write(f"{TARGET.name} is not as the Structs are: run python editor/protocol_types.py\n")
        return 1
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
