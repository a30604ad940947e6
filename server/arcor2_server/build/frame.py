"""The parts of a generated script around the logic: imports, objects, project parameters, entry point and names."""

import ast
import builtins
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.actions.parameter_types import PARAMETER_TYPES
from arcor2_hw.analysis import Enumeration
from arcor2_hw.data.object_type import ObjectAction, ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import CALL, Action, Project, ProjectFunction
from arcor2_hw.data.project_index import ProjectIndex
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidData, InvalidProject, NotFound
from arcor2_hw.parsing import parse
from arcor2_server.build import expressions
from arcor2_server.build.naming import Names
from arcor2_server.build.points import PointNames, names_of
from arcor2_server.build.style import Writer
from arcor2_server.documents.checks.actions import uses_of_parameter

NEXT_ACTION: Final = "next_action"
"""Variable with the name of the action that runs next, if that is not the next one in the text (see layout.py)."""
ERROR: Final = "error"
"""Variable with the caught error in an `except` block."""
REFERENCES: Final = frozenset({"pose", "position", "joints"})
"""Parameter types whose value is an id in the project."""
_ANNOTATIONS: Final = {"boolean": "bool", "integer": "int", "double": "float", "string": "str"}
"""The types of variables in Python."""
DOCSTRING: Final = "Main script of the project"
"""Start of the docstring of a generated script."""
_RESERVED: Final = ("_", "ActionPoints", "Resources", "aps", ERROR, "main", "print_exception", "res", NEXT_ACTION)
_FRAME: Final = """
def main(res: Resources) -> None:
    aps = ActionPoints(res)

if __name__ == "__main__":
    try:
        with Resources() as res:
            main(res)
    except Exception as error:
        print_exception(error)
"""


@dataclass(frozen=True, slots=True)
class TypeFacts:
    """What a script needs to know about an object type.

    Args:
        module: the module from which the script imports the type.
        shown_name: its name for users.
        actions: its actions by name.
        enumerations: parameter types of its actions, by action and parameter, with the module that defines them.
        keyword_only: keyword-only parameters, by action and parameter.
    """

    module: str
    shown_name: str
    actions: Mapping[str, ObjectAction]
    enumerations: Mapping[tuple[str, str], Enumeration] = field(default_factory=dict)
    keyword_only: frozenset[tuple[str, str]] = frozenset()


class ActionCall(NamedTuple):
    """The call of a method, or of a function, whose id is then that of the object and of the type."""

    object_id: str
    type_name: str
    method: str
    meta: ObjectAction


PARALLEL_CALL: Final = ActionCall("functions", "functions", "parallel", ObjectAction("parallel"))
"""The method that parallel work calls."""


class ParameterUse(NamedTuple):
    """The method that uses a parameter of a function first, and its own parameter."""

    call: ActionCall
    meta: ParameterMeta


class ChosenNames(NamedTuple):
    """The names that a person has chosen in a script: of objects by id, and of imports by module and name."""

    objects: Mapping[str, str]
    imports: Mapping[tuple[str, str], str]


class Frame:
    """The names of one script, and all of its code except the loop.

    Args:
        scene: the scene of the project.
        project: the project.
        types: the object types of the scene.
        own: names to use if they are free.
    """

    def __init__(
        self, scene: Scene, project: Project, types: Mapping[str, TypeFacts], own: ChosenNames | None = None
    ) -> None:
        self.scene, self.project, self.types = scene, project, types
        own = own or ChosenNames({}, {})
        self._own = own
        self.index = ProjectIndex(scene, project)
        self.points: PointNames = names_of(project)
        self.names = Names([*dir(builtins), *_RESERVED])
        self.objects = {obj.id: self.names.claim(own.objects.get(obj.id, obj.name)) for obj in scene.objects}
        self.imports: dict[tuple[str, str], str] = {}
        self.classes = {obj.id: self.imported(self._facts(obj.type).module, obj.type) for obj in scene.objects}
        self.parameters = {parameter.id: self.names.claim(parameter.name) for parameter in project.parameters}
        self.functions = {function.id: self.names.claim(function.name) for function in project.functions}
        self.function_facts: dict[str, TypeFacts] = {}
        """The functions as types with one action, as far as they are called."""
        self.variables = {parameter.name: parameter for parameter in project.parameters if parameter.variable}
        """The variables of the project, by name. Actions of the program store results in them."""
        self.comments: dict[ast.stmt, str] = {}

    def _facts(self, type_name: str) -> TypeFacts:
        try:
            return self.types[type_name]
        except KeyError:
            raise NotFound("unknown object type {type_name}", type_name=type_name) from None

    def imported(self, module: str, name: str) -> str:
        """Import a class if it is not imported yet; return its name in the script."""
        key = (module, name)
        if key not in self.imports:
            self.imports[key] = self.names.claim(self._own.imports.get(key, name), f"{name}Type")
        return self.imports[key]

    # ------------------------------------------------------------------------------------------------ module
    def module(self, loop: list[ast.stmt], functions: list[ast.stmt] | None = None) -> str:
        """Return the source code of the script, with functions and `loop` after the objects and project parameters."""
        return Writer(self.comments).module(self.tree(loop, functions))

    def tree(self, loop: list[ast.stmt], functions: list[ast.stmt] | None = None) -> ast.Module:
        """Return the syntax tree of the script, whose comments are in `comments`."""
        main, entry = parse(_FRAME).body
        assert isinstance(main, ast.FunctionDef)
        objects = [
            statement
            for obj in self.scene.objects
            for statement in parse(f"{self.objects[obj.id]}: {self.classes[obj.id]} = res.objects[{obj.id!r}]").body
        ]
        constants: list[ast.stmt] = [
            expressions.assign(self.parameters[parameter.id], self._constant(parameter))
            for parameter in self.project.parameters
            if not parameter.variable
        ]
        variables: list[ast.stmt] = [
            expressions.annotated(self.parameters[one.id], _ANNOTATIONS[one.type], self._constant(one))
            for one in self.variables.values()
            if one.type in _ANNOTATIONS
        ]
        if len(variables) < len(self.variables):
            one = next(one for one in self.variables.values() if one.type not in _ANNOTATIONS)
            raise InvalidProject("the variable {name!r} cannot be of type {type!r}", name=one.name, type=one.type)
        parts = (
            (objects, "Objects of the scene"),
            (constants, "Project parameters"),
            (variables, "Variables"),
            (functions or [], "Functions"),
        )
        for part, title in parts:
            if part:
                self.comments[part[0]] = title
                main.body += part
        main.body += loop
        heading = ast.Expr(ast.Constant(f"{DOCSTRING} {self.project.name}."))
        return ast.Module([heading, *self._imports(), main, entry], [])

    def _imports(self) -> list[ast.stmt]:
        imports: dict[str, list[ast.alias]] = {
            "action_points": [ast.alias("ActionPoints")],
            "arcor2_hw.runtime.exceptions": [ast.alias("print_exception")],
            "arcor2_hw.runtime.resources": [ast.alias("Resources")],
        }
        for (module, name), as_name in self.imports.items():
            imports.setdefault(module, []).append(ast.alias(name, None if as_name == name else as_name))
        return [
            ast.ImportFrom(module, sorted(aliases, key=lambda alias: alias.name), 0)
            for module, aliases in sorted(imports.items())
        ]

    def _constant(self, parameter: Parameter) -> ast.expr:
        kind = PARAMETER_TYPES.get(parameter.type)
        if kind is None or parameter.type in REFERENCES:
            raise InvalidProject(
                "project parameter {name!r} cannot be of type {type!r}", name=parameter.name, type=parameter.type
            )
        try:
            return kind.expression(parameter, References(self, "", {}, ""))
        except InvalidData as error:
            raise InvalidProject("project {reason}", reason=error) from error

    # ------------------------------------------------------------------------------------------------ actions
    def resolve(self, action: Action) -> ActionCall:
        """Return the method call of an action.

        Raises:
            InvalidProject: the action cannot be called.
            NotFound: the object type is unknown.
        """
        if action.is_parallel:
            return PARALLEL_CALL
        try:
            object_id, method = action.parse_type()
            if method == CALL and (function := self.index.find_function(object_id)) is not None:
                return ActionCall(object_id, object_id, CALL, self.facts_of(function).actions[CALL])
            obj = self.index.scene_object(object_id)
        except (ValueError, NotFound) as error:
            raise InvalidProject("action {name!r}: {reason}", name=action.name, reason=error) from error
        facts = self._facts(obj.type)
        found = facts.actions.get(method)
        if found is None:
            raise InvalidProject(
                "action {name!r}: {type} has no action {method}",
                name=action.name,
                type=facts.shown_name,
                method=method,
            )
        if found.disabled:
            raise InvalidProject(
                "action {name!r}: {method} of {type} cannot be used: {reason}",
                name=action.name,
                method=method,
                type=facts.shown_name,
                reason=found.why_disabled,
            )
        return ActionCall(object_id, obj.type, method, found)

    # ------------------------------------------------------------------------------------------------ functions
    def facts_of(self, function: ProjectFunction) -> TypeFacts:
        """Return the metadata of the calls of a function. Its parameters have the values of their first use."""
        if (facts := self.function_facts.get(function.id)) is not None:
            return facts
        # Stored before its actions are read, so that the search ends at a function that calls itself.
        meta = ObjectAction(CALL, returns=[result.type for result in function.returns])
        self.function_facts[function.id] = TypeFacts("", function.name, {CALL: meta})
        parameters: list[ParameterMeta] = []
        enumerations: dict[tuple[str, str], Enumeration] = {}
        for parameter in function.parameters:
            use = self.use_of(function, parameter.name)
            extra = UNSET if use is None else use.meta.extra
            parameters.append(ParameterMeta(parameter.name, parameter.type, extra=extra))
            if use is not None:
                kinds = self.types_of(use.call.type_name).enumerations
                if (kind := kinds.get((use.call.method, use.meta.name))) is not None:
                    enumerations[CALL, parameter.name] = kind
        facts = TypeFacts("", function.name, {CALL: replace(meta, parameters=parameters)}, enumerations)
        self.function_facts[function.id] = facts
        return facts

    def use_of(
        self, function: ProjectFunction, name: str, callers: frozenset[str] = frozenset()
    ) -> ParameterUse | None:
        """Return the first use of a parameter of a function, None if no action uses it.

        callers: ids of the functions that call this one, at which the search ends.
        """
        if function.id in callers:
            return None
        for action, parameter in uses_of_parameter(function, name):
            try:
                call = self.resolve(action)
            except InvalidProject:
                continue
            inner = self.index.find_function(call.object_id) if call.method == CALL else None
            if inner is not None:
                if (use := self.use_of(inner, parameter.name, callers | {function.id})) is not None:
                    return use
                continue
            meta = next((each for each in call.meta.parameters if each.name == parameter.name), None)
            if meta is not None:
                return ParameterUse(call, meta)
        return None

    def types_of(self, type_name: str) -> TypeFacts:
        """Return the facts of an object type, or of a function by its id."""
        return self.function_facts.get(type_name) or self._facts(type_name)


class References:
    """Expressions for the references in parameters of an action (`ScriptNames` of the parameter types)."""

    def __init__(
        self, frame: Frame, object_id: str, enumerations: Mapping[tuple[str, str], Enumeration], method: str
    ) -> None:
        self._frame = frame
        self._object_id = object_id
        self._enumerations = enumerations
        self._method = method

    @staticmethod
    def _point_attribute(what: str, names: Mapping[str, tuple[str, ...]], wanted: str) -> ast.expr:
        if wanted not in names:
            raise NotFound("the project has no {what} {wanted}", what=what, wanted=wanted)
        return expressions.dotted("aps", names[wanted])

    def pose(self, orientation_id: str) -> ast.expr:
        """Return the expression for the pose of an action point with this orientation."""
        return self._point_attribute("orientation", self._frame.points.poses, orientation_id)

    def position(self, action_point_id: str) -> ast.expr:
        """Return the expression for the position of an action point."""
        return self._point_attribute("action point", self._frame.points.positions, action_point_id)

    def joints(self, joints_id: str) -> ast.expr:
        """Return the expression for joints of an action point."""
        _, joints = self._frame.index.joints(joints_id)
        if joints.robot_id != self._object_id and self._object_id not in self._frame.functions:
            raise InvalidData("the joints {name} belong to another robot", name=joints.name)
        return self._point_attribute("joints", self._frame.points.joints, joints_id)

    def enum_member(self, parameter: Parameter, value: str | int) -> ast.expr:
        """Return the expression for the member with `value` of the enumeration of `parameter`."""
        kind = self._enumerations.get((self._method, parameter.name))
        if kind is None or value not in kind.members:
            raise InvalidData(
                "parameter {name}: {value!r} is not a member of the enumeration", name=parameter.name, value=value
            )
        first, *inner = kind.name.split(".")
        return expressions.dotted(self._frame.imported(kind.module, first), (*inner, kind.members[value]))
