"""The Structs match protocol.json: every request, event, type, field, default and enum value."""

import enum
from typing import Any

import msgspec
from msgspec import UNSET, inspect

from arcor2_hw.data.events import EVENTS, ChangeType
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import RPCS
from tests.protocol import PROTOCOL

TRANSLATION = {"key", "values"}
ADDED = {
    "Action": {"branches", "error_output", "retry"},
    "ActionMetadata": {"again", "verdict"},
    "AddAction.Request.Args": {"error_output", "retry"},
    "AddLogicItem.Request.Args": {"error_kinds", "when"},
    "AddProjectParameter.Request.Args": {"variable"},
    "Project": {"script"},
    "Scene": {"interlocks"},
    "ProjectParameter": {"variable"},
    "LogicItem": {"error_kinds", "when"},
    "UpdateAction.Request.Args": {"error_output", "retry"},
    "UpdateLogicItem.Request.Args": {"error_kinds", "when"},
    "ObjectTypeMeta": {"category", "display_name", "icon", "observable", "observations", "shadows"} | TRANSLATION,
    "ParameterMeta": {"address", "for_control", "former_names", "found_by", "secret"},
    "ObjectAction": {"category", "former_names", "icon"} | TRANSLATION,
    "RobotEef.Data": {"time_ms"},
    "RobotFeatures": {"jog", "acknowledge_stop", "kinematic_calibration"},
    "RobotJoints.Data": {"time_ms"},
    "ListProjects.Response.Data": {"problem_messages"},
    "ListScenes.Response.Data": {"problem_messages"},
    "AddObjectToScene.Request.Args": {"node"},
    "SceneObject": {"node"},
    "ActionResult.Data": TRANSLATION,
    "Notification.Data": TRANSLATION,
    "ProcessState.Data": TRANSLATION,
    "ProjectException.Data": {"action_id"} | TRANSLATION,
    "RobotMoveToActionPointJoints.Data": TRANSLATION,
    "RobotMoveToActionPointOrientation.Data": TRANSLATION,
    "RobotMoveToJoints.Data": TRANSLATION,
    "RobotMoveToPose.Data": TRANSLATION,
    "SceneState.Data": TRANSLATION,
    "RemoveActionArgs": {"with_steps"},
    "RunPackage.Request.Args": {
        *("checkpoints", "continue_at", "continues", "on_error", "order"),
        *("recipe_id", "recipe_values", "shared_breakpoints"),
    },
    "SystemInfo.Response.Data": {"cell"},
    "TemporaryPackage.Request.Args": {"checkpoints", "on_error", "shared_breakpoints"},
}
"""Optional fields that we add to the protocol (docs/protocol.md), by the name of the type."""


class Comparison:
    """Compares a type of the specification with one of ours and records the differences."""

    def __init__(self, types: dict[str, Any]) -> None:
        self.types = types
        self.differences: list[str] = []
        self.compared: set[str] = set()
        self._seen: set[tuple[str, Any]] = set()

    def differ(self, where: str, what: str) -> None:
        self.differences.append(f"{where}: {what}")

    def same(self, where: str, theirs: dict[str, Any], ours: inspect.Type) -> None:
        if isinstance(ours, inspect.UnionType):
            rest = [kind for kind in ours.types if not isinstance(kind, inspect.UnsetType)]
            if len(rest) != 1:
                self.differ(where, f"{len(rest)} alternatives")
                return
            (ours,) = rest
        if theirs["kind"] == "optional":
            theirs = theirs["of"]
        match theirs["kind"]:
            case "string":
                # `value` and the like are plain text; a time stamp is a text with a pattern.
                self.expect(where, isinstance(ours, inspect.StrType), ours)
            case "integer":
                self.expect(where, isinstance(ours, inspect.IntType), ours)
            case "number":
                self.expect(where, isinstance(ours, inspect.FloatType), ours)
            case "boolean":
                self.expect(where, isinstance(ours, inspect.BoolType), ours)
            case "array":
                if self.expect(where, isinstance(ours, inspect.ListType), ours):
                    self.same(where + "[]", theirs["items"], ours.item_type)  # type: ignore[attr-defined]
            case "set(json array, unique)":
                if self.expect(where, isinstance(ours, inspect.SetType), ours):
                    self.same(where + "{}", theirs["items"], ours.item_type)  # type: ignore[attr-defined]
            case "enum":
                if self.expect(where, isinstance(ours, inspect.EnumType), ours):
                    self.same_enum(where, theirs["name"], ours.cls)  # type: ignore[attr-defined]
            case "object":
                if self.expect(where, isinstance(ours, inspect.StructType), ours):
                    self.same_struct(where, theirs["name"], ours)  # type: ignore[arg-type]
            case unknown:
                raise AssertionError(unknown)

    def expect(self, where: str, right: bool, ours: inspect.Type) -> bool:
        if not right:
            self.differ(where, f"is {ours}")
        return right

    def same_enum(self, where: str, name: str, ours: type[enum.Enum]) -> None:
        self.compared.add(name)
        if set(self.types[name]["values"].values()) != {member.value for member in ours}:
            self.differ(where, f"{ours.__name__} has other values than {name}")

    def same_struct(self, where: str, name: str, ours: inspect.StructType) -> None:
        self.compared.add(name)
        if (name, ours.cls) in self._seen:
            return
        self._seen.add((name, ours.cls))
        fields = {field.encode_name: field for field in ours.fields}
        # `inspect` leaves UNSET out.
        unset = {field.encode_name for field in msgspec.structs.fields(ours.cls) if field.default is UNSET}
        theirs = {field["name"]: field for field in self.types[name]["fields"]}
        for added in ADDED.get(name, ADDED.get(ours.cls.__name__, ())):
            taken = ours.cls.__name__.endswith("Args")  # in sent types, older clients would get the default, too
            self.expect(f"{where}.{added}", added in unset or (taken and not fields[added].required), ours)
            del fields[added]
        if set(fields) != set(theirs):
            self.differ(where, f"{name} has {sorted(set(theirs) - set(fields))}, we have {set(fields) - set(theirs)}")
        for key in set(fields) & set(theirs):
            field, place = theirs[key], f"{where}.{key}"
            optional = field["type"]["kind"] == "optional"
            self.same(place, field["type"], fields[key].type)
            if field["required"] != fields[key].required:
                self.differ(place, f"required: theirs {field['required']}, ours {fields[key].required}")
            if optional != (key in unset):
                self.differ(place, f"optional: theirs {optional}, ours {key in unset}")
            default = field.get("default")
            if not optional and default is not None and self.default(fields[key]) != default:
                self.differ(place, f"default: theirs {default!r}, ours {self.default(fields[key])!r}")

    @staticmethod
    def default(field: inspect.Field) -> Any:
        value = field.default if field.default_factory is inspect.NODEFAULT else field.default_factory()
        return msgspec.to_builtins(value)


def test_requests_match_the_protocol() -> None:
    comparison = Comparison(PROTOCOL["types"])
    assert {name for name, rpc in RPCS.items() if not rpc.additional} == set(PROTOCOL["requests"])
    for name, theirs in PROTOCOL["requests"].items():
        ours = RPCS[name]
        # Arguments of our own may be added, if they are optional.
        assert (ours.args is None) == (theirs["args"] is None) or ours.args_optional, name
        assert (ours.data is None) == (theirs["response_data"] is None), name
        if theirs["args"] is not None:
            comparison.same(name, theirs["args"], inspect.type_info(ours.args))
            assert ours.args_optional is not theirs["args_required"], name
        if theirs["response_data"] is not None:
            comparison.same(f"{name} answers", theirs["response_data"], inspect.type_info(ours.data))
        assert ours.dry_run is theirs["dry_run"], name
    assert comparison.differences == []


def test_events_match_the_protocol() -> None:
    comparison = Comparison(PROTOCOL["types"])
    assert {name for name, event in EVENTS.items() if not event.additional} == set(PROTOCOL["events"])
    for name, theirs in PROTOCOL["events"].items():
        ours = EVENTS[name]
        assert (ours.data is None) == (theirs["data"] is None), name
        if theirs["data"] is not None:
            comparison.same(name, theirs["data"], inspect.type_info(ours.data))
    comparison.same_enum("change_type", "Event.Type", ChangeType)
    assert comparison.differences == []


def test_every_protocol_type_is_compared() -> None:
    comparison = Comparison(PROTOCOL["types"])
    for name, theirs in PROTOCOL["requests"].items():
        for kind, ours in ((theirs["args"], RPCS[name].args), (theirs["response_data"], RPCS[name].data)):
            if kind is not None:
                comparison.same(name, kind, inspect.type_info(ours))
    for name, theirs in PROTOCOL["events"].items():
        if theirs["data"] is not None:
            comparison.same(name, theirs["data"], inspect.type_info(EVENTS[name].data))
    # The envelope, and the answer of a request that ARServer does not expose.
    outside = {"Event", "Event.Type", "Version.Response.Data"}
    assert set(PROTOCOL["types"]) - comparison.compared == outside


def test_every_request_and_event_declares_its_least_role() -> None:
    for declared in [*RPCS.values(), *EVENTS.values()]:
        assert isinstance(declared.role, Role), declared.name


def test_comparison_finds_a_misspelt_field() -> None:
    class Wrong(msgspec.Struct):
        object_id: str
        lock_trees: bool = False

    comparison = Comparison(PROTOCOL["types"])
    comparison.same("WriteLock", {"kind": "object", "name": "WriteLock.Request.Args"}, inspect.type_info(Wrong))
    assert len(comparison.differences) == 1
