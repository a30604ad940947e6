"""The result of analysing one object type."""

from msgspec import field

from arcor2_hw.analysis.enumerations import Enumeration
from arcor2_hw.analysis.source import Problem, SourceFile
from arcor2_hw.data.base import Data
from arcor2_hw.data.object_type import ObjectAction, ObjectTypeMeta
from arcor2_hw.data.robot import RobotMeta


class TypeAnalysis(Data, frozen=True):
    """The analysis of one object type's source.

    Attributes:
        is_object_type: False for a helper class or mixin that does not derive from Generic; it is hidden from clients.
        robot: None for a type that is not a robot, or cannot be added to a scene.
        implemented: The optional methods of our bases that the type implements.
        bases: The object types it derives from, nearest first.
        mixins: Classes before its base.
        enumerations: The enumerations of its actions, by action and parameter.
        keyword_only: Keyword-only parameters, as (action, parameter).
        modules: The other required files, each after its own requirements; without our files, and without packages
            that only contain them.
        lookups: Full names of the modules that were looked for, except ours and those of distributions without an
            object type. The analysis is outdated when a module of such a name, or below it, is added or removed.
    """

    meta: ObjectTypeMeta
    actions: tuple[ObjectAction, ...] = ()
    robot: RobotMeta | None = None
    implemented: frozenset[str] = frozenset()
    bases: tuple[str, ...] = ()
    mixins: tuple[str, ...] = ()
    modules: tuple[SourceFile, ...] = ()
    lookups: frozenset[str] = frozenset()
    is_object_type: bool = True
    problem: Problem | None = None
    enumerations: dict[tuple[str, str], Enumeration] = field(default_factory=dict)
    keyword_only: frozenset[tuple[str, str]] = frozenset()
