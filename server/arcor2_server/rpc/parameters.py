"""Requests about project parameters and overridden settings (protocol, 7.3, 7.4 and 10.5)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import UNSET, Unset, new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Action, ProjectParameter
from arcor2_hw.data.rpc import (
    AddOverrideArgs,
    AddProjectParameterArgs,
    DeleteOverrideArgs,
    RemoveProjectParameterArgs,
    UpdateOverrideArgs,
    UpdateProjectParameterArgs,
)
from arcor2_hw.data.scene import SceneObjectOverride
from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_server.collaboration.locks import PROJECT, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Change, Kind
from arcor2_server.documents.checks.project import check_project_parameter
from arcor2_server.documents.checks.scene import check_setting
from arcor2_server.documents.document import Document
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc


def _index(overrides: list[Parameter], name: str) -> int:
    for index, override in enumerate(overrides):
        if override.name == name:
            return index
    raise NotFound("The setting {name} is not overridden.", name=name)


def _with_output(action: Action, before: str, after: str) -> Action:
    flows = [
        replace(flow, outputs=[after if output == before else output for output in flow.outputs])
        for flow in action.flows
    ]
    return replace(action, flows=flows)


def _require_no_result(document: Document, parameter: ProjectParameter) -> None:
    """Raise InvalidData if a result of an action has the name of a variable, which would be stored in it."""
    if parameter.variable and (action := document.naming(parameter.name)) is not None:
        raise InvalidData(
            "{name} names a result {output} already: choose another name.", name=action.name, output=parameter.name
        )


@dataclass(frozen=True, slots=True)
class ParameterRequests:
    """Requests about project parameters and overridden settings (protocol, 7.3, 7.4 and 10.5)."""

    _locks: Locks
    _types: ObjectTypes
    _session: Session
    _editing: Editing

    @rpc("AddProjectParameter")
    async def add_project_parameter(self, context: Context, args: AddProjectParameterArgs) -> None:
        """Add a project parameter, a constant for its actions."""
        document = self._session.require_project_open()
        async with self._locks.auto(context.user, PROJECT):
            variable = args.variable or UNSET
            parameter = ProjectParameter(args.name, args.type, args.value, id=new_id("pco"), variable=variable)
            check_project_parameter(parameter)
            self._editing.require_name_free(Kind.PARAMETER, args.name, "a project parameter")
            _require_no_result(document, parameter)
            await self._editing.commit_one(context, document.add(Kind.PARAMETER, parameter.id, parameter))

    @rpc("UpdateProjectParameter")
    async def update_project_parameter(self, context: Context, args: UpdateProjectParameterArgs) -> None:
        """Change the name or the value of a project parameter, or both."""
        document = self._session.require_project_open()
        parameter = document.parameter(args.id)
        self._editing.require_locked(context, args.id)
        updated = parameter
        if not isinstance(args.name, Unset) and args.name != parameter.name:
            self._editing.require_name_free(Kind.PARAMETER, args.name, "a project parameter")
            updated = replace(updated, name=args.name)
        if not isinstance(args.value, Unset):
            updated = replace(updated, value=args.value)
        check_project_parameter(updated)
        # Actions that store results in a variable contain its name.
        storing = document.storing(parameter) if updated.name != parameter.name else []
        async with self._locks.auto_skip_held(context.user, *(action.id for action in storing)):
            renamed: list[Action] = []
            if updated.name != parameter.name:
                _require_no_result(document, updated)
                renamed = [_with_output(one, parameter.name, updated.name) for one in document.storing(parameter)]
            changes = [document.update(Kind.PARAMETER, args.id, updated)]
            changes += [document.update(Kind.ACTION, action.id, action) for action in renamed]
            if await self._editing.commit(context, changes):
                context.emit("ProjectParameterChanged", updated, ChangeType.UPDATE)
                for action in renamed:
                    context.emit("ActionChanged", action, ChangeType.UPDATE)
                self._editing.unlock(context, args.id)

    @rpc("RemoveProjectParameter")
    async def remove_project_parameter(self, context: Context, args: RemoveProjectParameterArgs) -> None:
        """Remove a project parameter. Refuse while an action uses it."""
        document = self._session.require_project_open()
        async with self._locks.auto_skip_held(context.user, args.id):
            parameter = document.parameter(args.id)
            for user in document.users_of(args.id):
                if not isinstance(user, Action):
                    raise RequestRefused("A condition uses the project parameter {name}.", name=parameter.name)
                raise RequestRefused(
                    "The action {name} uses the project parameter {parameter_name}.",
                    name=user.name,
                    parameter_name=parameter.name,
                )
            for action in document.storing(parameter):
                raise RequestRefused(
                    "The action {name} stores a result in the variable {parameter_name}.",
                    name=action.name,
                    parameter_name=parameter.name,
                )
            if await self._editing.commit_one(context, document.remove(Kind.PARAMETER, args.id)):
                self._editing.drop_locks(context, args.id)

    # ---------------------------------------------------------------------------------------------- overrides
    def _overrides(self, object_id: str, given: Parameter) -> tuple[Document, list[Parameter]]:
        """Return the document and the overrides of an object; check that `given` is a valid value of a setting."""
        document = self._session.require_project_open()
        obj = document.scene_object(object_id)
        meta = self._types.meta(obj.type)
        settings = {setting.name: setting for setting in meta.settings}
        if given.name not in settings:
            raise NotFound("{type} has no setting {name}.", type=meta.shown_name, name=given.name)
        check_setting(given, settings[given.name])
        item = document.find(Kind.OVERRIDE, object_id)
        return document, [] if item is None else list(item.value.parameters)

    async def _set_overrides(
        self,
        context: Context,
        document: Document,
        object_id: str,
        overrides: list[Parameter],
        given: Parameter,
        change_type: ChangeType,
    ) -> None:
        """Replace all overrides of an object, and publish the changed one, `given`."""
        self._editing.require_locked(context, object_id)
        value = SceneObjectOverride(object_id, overrides)
        change: Change
        if document.find(Kind.OVERRIDE, object_id) is None:
            change = document.add(Kind.OVERRIDE, object_id, value)
        elif overrides:
            change = document.update(Kind.OVERRIDE, object_id, value)
        else:
            change = document.remove(Kind.OVERRIDE, object_id)
        if await self._editing.commit(context, [change]):
            context.emit("OverrideUpdated", given, change_type, object_id)

    async def _without_secret(self, context: Context, object_id: str, given: Parameter) -> Parameter:
        """Return an override. The value of a secret setting is stored and replaced by a reference.

        Raises:
            InvalidData: a secret setting has no value.
        """
        document, overrides = self._overrides(object_id, given)
        self._editing.require_locked(context, object_id)
        others = [override for override in overrides if override.name != given.name]
        obj = document.scene_object(object_id)
        hidden = await self._editing.hide_secrets(context, obj, [*others, given], overrides, of_project=True)
        if not hidden or hidden[-1].name != given.name:
            raise InvalidData("Enter a value for the secret setting {name}: none is stored.", name=given.name)
        return hidden[-1]

    @rpc("AddOverride")
    async def add_override(self, context: Context, args: AddOverrideArgs) -> None:
        """Override a setting of an object in the project."""
        given = await self._without_secret(context, args.id, args.override)
        document, overrides = self._overrides(args.id, given)
        if any(override.name == args.override.name for override in overrides):
            raise InvalidData("The setting {name} is overridden already: update the override.", name=args.override.name)
        await self._set_overrides(context, document, args.id, [*overrides, given], given, ChangeType.ADD)

    @rpc("UpdateOverride")
    async def update_override(self, context: Context, args: UpdateOverrideArgs) -> None:
        """Change the value of an override."""
        given = await self._without_secret(context, args.id, args.override)
        document, overrides = self._overrides(args.id, given)
        overrides[_index(overrides, given.name)] = given
        await self._set_overrides(context, document, args.id, overrides, given, ChangeType.UPDATE)

    @rpc("DeleteOverride")
    async def delete_override(self, context: Context, args: DeleteOverrideArgs) -> None:
        """Delete an override. The setting has the value of the scene again."""
        document, overrides = self._overrides(args.id, args.override)
        del overrides[_index(overrides, args.override.name)]
        await self._set_overrides(context, document, args.id, overrides, args.override, ChangeType.REMOVE)
