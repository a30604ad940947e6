"""The object types of the server combined with those of a package, for checking an import before it is written."""

from collections.abc import Iterable, Mapping

import msgspec

from arcor2_hw.analysis import Enumeration, Library, SourceFile, TypeAnalysis, module_name
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta, ObjectTypeSource
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidData, InvalidPackage, NotFound
from arcor2_server.build import snapshot
from arcor2_server.build.frame import TypeFacts
from arcor2_server.object_types.catalog import action_of, robot_of


class CombinedTypes:
    """Look-ups over object types; a `Types` of documents.checks. Each raises NotFound if the type is unknown.

    Args:
        known: sources on this server. If two have the same name, the later one is used.
        packaged: types of the package by name. They replace known types of the same name.
    """

    def __init__(self, known: Iterable[SourceFile], packaged: Mapping[str, ObjectTypeSource]) -> None:
        self._packaged = packaged
        self._library = Library(known)
        for name, packaged_type in packaged.items():
            try:
                self._library.add(SourceFile.of_upload(packaged_type))
            except InvalidData as error:
                raise InvalidPackage("object type {name}: {reason}", name=name, reason=error) from error

    def analysis(self, name: str) -> TypeAnalysis:
        """Return the analysis of the source of a type, helper or mixin."""
        if name not in self._library:
            raise NotFound("The object type {name} is neither in the package nor on this server.", name=name)
        return self._library.analyse(name)

    def meta(self, name: str) -> ObjectTypeMeta:
        """Return the metadata of a type."""
        found = self.analysis(name)
        if not found.is_object_type:
            raise NotFound("{name} is not an object type.", name=name)
        packaged = self._packaged.get(name)
        return found.meta if packaged is None else msgspec.structs.replace(found.meta, object_model=packaged.model)

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Return an action by its present or a former name."""
        found = self.analysis(type_name)
        return action_of(found.meta, found.actions, name)

    def robot_meta(self, name: str) -> RobotMeta:
        """Return the metadata of a robot type. Raise NotFound if the type is not a robot."""
        found = self.analysis(name)
        return robot_of(found.meta, found.robot)

    def enumerations(self, name: str) -> dict[tuple[str, str], Enumeration]:
        """Return the enumerations that are parameter types of a type's actions, by action and parameter."""
        return self.analysis(name).enumerations

    def facts(self, scene: Scene) -> dict[str, TypeFacts]:
        """Return the facts about the types of a scene that a script needs, by type."""
        facts: dict[str, TypeFacts] = {}
        for name in {obj.type for obj in scene.objects}:
            found = self.analysis(name)
            module = f"{snapshot.FOLDER}.{module_name(name)}"
            actions = {one.name: one for one in found.actions}
            facts[name] = TypeFacts(module, found.meta.shown_name, actions, found.enumerations, found.keyword_only)
        return facts
