"""Generate src/protocol/types.ts, the protocol as TypeScript, from the Structs with which the server decodes.

`python editor/protocol_types.py` writes the file. With `--check` it compares only: the exit status is 1 if the file is
outdated.
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
from arcor2_server.fleet.registry import FleetUpdate
from arcor2_server.fleet.reports import FleetAlarm, FleetCause, FleetProduction, FleetUnit

TARGET: Final = Path(__file__).resolve().parent / "src" / "protocol" / "types.ts"
"""Generated file."""
HEAD: Final = """/**
 * The protocol's data, requests and events. Generated from arcor2_hw.data by editor/protocol_types.py: do not edit.
 *
 * A field with `?` may be omitted. Lengths are in m, angles in rad, quaternions x, y, z, w.
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


class Declarations:
    """TypeScript declarations of Python types, each type once."""

    def __init__(self) -> None:
        self.by_name: dict[str, str] = {}
        """Declarations by the name of the type."""
        self.sent: set[type] = set()
        """Structs that the server sends. Their fields with a default are always present."""

    def add_sent(self, kind: Any) -> None:
        """Add the Structs that a type hint of the server's data contains to `sent`."""
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
            if kind in self.sent:
                return
            self.sent.add(kind)
            for field in msgspec.structs.fields(kind):
                self.add_sent(field.type)
        for argument in typing.get_args(kind):
            self.add_sent(argument)

    def expression(self, kind: Any) -> str:
        """Return the TypeScript type of a type hint, and declare the Structs and enums that it contains.

        Raises:
            TypeError: if the hint has no TypeScript counterpart.
        """
        if kind is None or kind in _SCALARS:
            return "null" if kind is None else _SCALARS[kind]
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if origin is typing.Annotated:
            return self.expression(arguments[0])
        if origin in (typing.Union, types.UnionType):
            return " | ".join(dict.fromkeys(self.expression(each) for each in arguments if each is not UnsetType))
        if origin is typing.Literal:
            return " | ".join(json.dumps(each) for each in arguments)
        if origin in (list, set, frozenset) or (origin is tuple and arguments[1:] == (...,)):
            inner = self.expression(arguments[0])
            return f"({inner})[]" if "|" in inner else f"{inner}[]"
        if origin is tuple:
            return f"[{', '.join(self.expression(each) for each in arguments)}]"
        if origin is dict:
            return f"Record<string, {self.expression(arguments[1])}>"
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            if kind.__name__ not in self.by_name:
                values = " | ".join(json.dumps(each.value) for each in kind)
                self.by_name[kind.__name__] = f"{_comment(kind)}export type {kind.__name__} = {values};\n"
            return kind.__name__
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
            self._declare(kind)
            return kind.__name__
        raise TypeError(f"{kind!r} has no TypeScript counterpart. Extend {Path(__file__).name}.")

    def _declare(self, kind: type[msgspec.Struct]) -> None:
        if kind.__name__ in self.by_name:
            return
        self.by_name[kind.__name__] = ""  # the Struct may contain itself
        lines = []
        for field in msgspec.structs.fields(kind):
            unset = UnsetType in typing.get_args(field.type) or field.type is UnsetType
            sent = kind in self.sent and not kind.__struct_config__.omit_defaults
            optional = unset or (not field.required and not sent)
            lines.append(f"  {field.encode_name}{'?' if optional else ''}: {self.expression(field.type)};\n")
        self.by_name[kind.__name__] = f"{_comment(kind)}export interface {kind.__name__} {{\n{''.join(lines)}}}\n"


def _comment(kind: type) -> str:
    text = inspect.cleandoc(kind.__doc__ or "").replace("*/", "* /")
    if not text or text.startswith(f"{kind.__name__}("):
        return ""
    lines = text.splitlines()
    if len(lines) == 1:
        return f"/** {lines[0]} */\n"
    return "/**\n" + "".join(f" * {each}".rstrip() + "\n" for each in lines) + " */\n"


def typescript() -> str:
    """Return the content of the generated file."""
    declarations = Declarations()
    for rpc in RPCS.values():
        declarations.add_sent(rpc.data)
    for event in EVENTS.values():
        declarations.add_sent(event.data)
    for sent in (FleetUpdate, FleetProduction, FleetUnit, FleetAlarm, FleetCause):
        declarations.add_sent(sent)
        declarations.expression(sent)
    requests, roles_of_requests = [], []
    for name, rpc in sorted(RPCS.items()):
        args = "undefined" if rpc.args is None else declarations.expression(rpc.args)
        if rpc.args is not None and rpc.args_optional:
            args += " | undefined"
        data = "undefined" if rpc.data is None else declarations.expression(rpc.data)
        requests.append(f"  {name}: {{ args: {args}; data: {data} }};\n")
        roles_of_requests.append(f"  {name}: {int(rpc.role)},\n")
    events = [
        f"  {name}: {'undefined' if event.data is None else declarations.expression(event.data)};\n"
        for name, event in sorted(EVENTS.items())
    ]
    additional = [f'  "{name}",\n' for name, event in sorted(EVENTS.items()) if event.additional]
    change = declarations.expression(ChangeType)
    declared = "\n".join(text for _, text in sorted(declarations.by_name.items()))
    roles = "".join(f"  {role.name.lower()}: {int(role)},\n" for role in Role)
    return (
        f"{HEAD}\n{declared}\n"
        f"/** Arguments and response data of each request. */\nexport interface Requests {{\n{''.join(requests)}}}\n\n"
        f"/** Data of each event. */\nexport interface Events {{\n{''.join(events)}}}\n\n"
        "/** An event as the server sends it. */\n"
        "export type ServerEvent = {\n  [Name in keyof Events]: {\n    event: Name;\n    data: Events[Name];\n"
        f"    change_type?: {change};\n    parent_id?: string;\n  }};\n}}[keyof Events];\n\n"
        "/** Roles. Each includes the permissions of the lower ones. */\n"
        f"export const ROLES = {{\n{roles}}} as const;\n\n"
        "/** Lowest role that may send each request. */\n"
        f"export const MIN_ROLE: Record<keyof Requests, number> = {{\n{''.join(roles_of_requests)}}};\n\n"
        "/** Additional events, sent only to clients that subscribed to them. */\n"
        f"export const ADDITIONAL_EVENTS = [\n{''.join(additional)}] as const satisfies (keyof Events)[];\n"
    )


def main() -> int:
    """Write the file, or compare it with `--check`, and return the exit status."""
    text = typescript()
    if sys.argv[1:] == ["--check"]:
        if TARGET.is_file() and TARGET.read_text() == text:
            return 0
        sys.stderr.write(f"{TARGET.name} is outdated. Run: python editor/protocol_types.py\n")
        return 1
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
