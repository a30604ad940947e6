"""Parameter types of parts of a project, poses, positions and joints, and of images."""

import abc
import ast
import copy
from typing import Any, ClassVar

from arcor2_hw.actions.json_values import decode_picture, encode, is_picture
from arcor2_hw.actions.parameter_type import ParameterType, ScriptNames, read_reference
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.project_index import ProjectLookup, global_pose
from arcor2_hw.exceptions import Arcor2Error, InvalidData


class _Reference(ParameterType):
    """A part of the project, by its id."""

    result_type: ClassVar[type]
    what: ClassVar[str]

    @abc.abstractmethod
    def _find(self, reference: str, lookup: ProjectLookup) -> Any:
        """Return the referenced value at execution.

        Raises:
            NotFound: The id is unknown.
        """

    def _resolve(self, parameter: Parameter, lookup: ProjectLookup | None) -> Any:
        reference = read_reference(parameter)
        if lookup is None:
            raise InvalidData(
                "parameter {name}: {what} is available in a project only", name=parameter.name, what=self.what
            )
        try:
            return self._find(reference, lookup)
        except Arcor2Error as error:
            raise InvalidData("parameter {name}: {reason}", name=parameter.name, reason=error) from error

    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Check that the id is known."""
        self._check_type(parameter, meta)
        self._resolve(parameter, lookup)

    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Return a copy of the referenced value, in the world."""
        return copy.deepcopy(self._resolve(parameter, lookup))

    def encode(self, result: Any) -> str:
        """Convert the value to JSON.

        Raises:
            InvalidData: It is of another kind.
        """
        if not isinstance(result, self.result_type):
            raise InvalidData(
                "{result!r:.80} is not a {result_type}", result=result, result_type=self.result_type.__name__
            )
        return encode(result)


class PoseType(_Reference):
    """A pose: the id of an orientation. Its action point provides the position."""

    name = "pose"
    annotations = frozenset({"Pose"})
    result_type = Pose
    what = "a pose"

    def _find(self, reference: str, lookup: ProjectLookup) -> Pose:
        point, named = lookup.orientation(reference)
        return global_pose(lookup, point, named.orientation)

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Return the pose by the names of action point and orientation."""
        return names.pose(read_reference(parameter))


class PositionType(_Reference):
    """A position: the id of an action point."""

    name = "position"
    annotations = frozenset({"Position"})
    result_type = Position
    what = "a position"

    def _find(self, reference: str, lookup: ProjectLookup) -> Position:
        return global_pose(lookup, lookup.action_point(reference)).position

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Return the position by the name of its action point."""
        return names.position(read_reference(parameter))


class JointsType(_Reference):
    """Joint values of the action's robot, by their id."""

    name = "joints"
    annotations = frozenset({"ProjectRobotJoints"})
    result_type = ProjectRobotJoints
    what = "joint values"

    def _find(self, reference: str, lookup: ProjectLookup) -> ProjectRobotJoints:
        return lookup.joints(reference)[1]

    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Check that the id is known, and that the joints belong to the robot."""
        self._check_type(parameter, meta)
        joints = self._resolve(parameter, lookup)
        if robot_id is not None and joints.robot_id != robot_id:
            raise InvalidData(
                "parameter {name}: joints {joints_name} belong to another robot",
                name=parameter.name,
                joints_name=joints.name,
            )

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Return the joints by the names of action point and joints."""
        return names.joints(read_reference(parameter))


class ImageType(ParameterType):
    """An image, which can only be a result or a link to a result, never a literal."""

    name = "image"
    annotations = frozenset({"Image", "Image.Image"})

    def _refuse(self, parameter: Parameter) -> InvalidData:
        return InvalidData("parameter {name}: an image can only be linked to a result", name=parameter.name)

    def check(
        self,
        parameter: Parameter,
        meta: ParameterMeta | None,
        lookup: ProjectLookup | None = None,
        robot_id: str | None = None,
    ) -> None:
        """Reject the literal."""
        raise self._refuse(parameter)

    def value(self, parameter: Parameter, lookup: ProjectLookup | None = None) -> Any:
        """Reject the literal."""
        raise self._refuse(parameter)

    def expression(self, parameter: Parameter, names: ScriptNames) -> ast.expr:
        """Reject the literal."""
        raise self._refuse(parameter)

    def encode(self, result: Any) -> str:
        """Convert the image to JSON."""
        if not is_picture(result):
            raise InvalidData("{result!r:.80} is not an image", result=result)
        return encode(result)

    def decode_json(self, text: str, annotation: Any) -> Any:
        """Convert an image from JSON."""
        return decode_picture(text)
