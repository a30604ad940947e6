"""The object types of the server combined with those of a package, for checking an import before it is written."""

from collections.abc import Iterable, Mapping

import msgspec

from arcor2_hw.analysis import Enumeration, Library, SourceFile, TypeAnalysis, module_name
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta, ObjectTypeSource, find_action
from arcor2_hw.data.robot import RobotMeta
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import InvalidData, InvalidPackage, NotFound
from arcor2_server.build import snapshot
from arcor2_server.build.frame import TypeFacts


class Candidates:
    """Look-ups over object types (`Types` of session.checks); each raises NotFound for a type that is not known.

    known: the sources that are here; of two with one name the later counts. given: those of the package, which take the
    place of those of the same names.
    """

    def __init__(self, known: Iterable[SourceFile], given: Mapping[str, ObjectTypeSource]) -> None:
        self._given = given
        self._library = Library(known)
        for name, one in given.items():
            try:
                self._library.add(SourceFile(name, module_name(name), one.source))
            except InvalidData as error:
                raise InvalidPackage("object type {name}: {reason}", name=name, reason=error) from error

    def analysis(self, name: str) -> TypeAnalysis:
        """Return the analysis of the source of a type, helper or mixin."""
        if name not in self._library:
            raise NotFound("The object type {name} is neither in the package nor here.", name=name)
        return self._library.analyse(name)

    def meta(self, name: str) -> ObjectTypeMeta:
        """Return one type."""
        found = self.analysis(name)
        if not found.is_object_type:
            raise NotFound("{name} is no object type.", name=name)
        given = self._given.get(name)
        return found.meta if given is None else msgspec.structs.replace(found.meta, object_model=given.model)

    def action(self, type_name: str, name: str) -> ObjectAction:
        """Return one action, by its name or a former one."""
        if (action := find_action(self.analysis(type_name).actions, name)) is not None:
            return action
        raise NotFound("The object type {type_name} has no action {name!r}.", type_name=type_name, name=name)

    def robot_meta(self, name: str) -> RobotMeta:
        """Return the features of a robot type; raise NotFound when it is none."""
        if (robot := self.analysis(name).robot) is None:
            raise NotFound("The object type {name} is not a robot.", name=name)
        return robot

    def enumerations(self, name: str) -> dict[tuple[str, str], Enumeration]:
        """Return the enumerations that the actions of a type take."""
        return self.analysis(name).enumerations

    def facts(self, scene: Scene) -> dict[str, TypeFacts]:
        """Return the facts that a script needs about the types in a scene: all their actions."""
        facts: dict[str, TypeFacts] = {}
        for name in {obj.type for obj in scene.objects}:
            found = self.analysis(name)
            module = f"{snapshot.FOLDER}.{module_name(name)}"
            facts[name] = TypeFacts(
                module, {one.name: one for one in found.actions}, found.enumerations, found.keyword_only
            )
        return facts
