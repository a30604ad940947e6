"""Requests that determine the pose of an object by touching its focus points with a robot (protocol, 7.3)."""

from dataclasses import dataclass
from typing import Final

import structlog

from arcor2_hw.data.base import Unset
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.object_type import Mesh
from arcor2_hw.data.rpc import ObjectAimingAddPointArgs, ObjectAimingAddPointData, ObjectAimingStartArgs
from arcor2_hw.data.scene import SceneObject
from arcor2_server.documents import Session
from arcor2_server.errors import RequestRefused
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc
from arcor2_server.rpc.scene_objects import SceneObjectRequests
from arcor2_server.workspace.object_aiming import ObjectAiming, ObjectAimings
from arcor2_server.workspace.point_registration import check_points, fit
from arcor2_server.workspace.robots import optional

log = structlog.get_logger(__name__)

WORST_MISS: Final = 0.05
"""Maximum distance of a touched point from its focus point, m. If it is larger, another point was touched."""


@dataclass(frozen=True, slots=True)
class ObjectAimingRequests:
    """Requests that determine the pose of an object by touching its focus points with a robot (protocol, 7.3)."""

    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _object_aiming: ObjectAimings
    _editing: Editing
    _scene_object_requests: SceneObjectRequests

    def _focus_points(self, obj: SceneObject) -> list[Pose]:
        """Return the focus points of an object's mesh.

        Raises:
            InvalidData: the focus points do not determine a pose.
            RequestRefused: the object has no pose or no focus points.
        """
        if isinstance(obj.pose, Unset):
            raise RequestRefused("{name} has no pose.", name=obj.name)
        wrapped = self._types.meta(obj.type).object_model
        model = None if isinstance(wrapped, Unset) else wrapped.model()
        if not isinstance(model, Mesh) or isinstance(model.focus_points, Unset) or not model.focus_points:
            raise RequestRefused("{name} has no mesh with focus points.", name=obj.name)
        check_points([point.position for point in model.focus_points], f"Focus points of {obj.type}")
        return model.focus_points

    @rpc("ObjectAimingStart")
    async def object_aiming_start(self, context: Context, args: ObjectAimingStartArgs) -> None:
        """Start to touch the focus points of an object with a robot."""
        robot = args.robot
        document = self._session.require_scene_alone()
        self._online.require_online()
        user = context.user
        if self._object_aiming.of(user, document) is not None:
            raise RequestRefused("You are already aiming at an object. Finish or cancel that first.")
        points = self._focus_points(document.scene_object(args.object_id))
        self._online.robot(robot.robot_id)
        self._editing.require_locked(context, args.object_id)
        self._editing.require_locked(context, robot.robot_id)
        # Check that the robot has this arm and end effector, and knows its pose.
        await self._online.end_effector_pose(robot.robot_id, robot.end_effector, optional(robot.arm_id))
        if self._object_aiming.of(user, self._session.require_scene_alone()) is not None:
            raise RequestRefused("You are already aiming at an object. Finish or cancel that first.")
        if not context.dry_run:
            self._object_aiming.begin(user, ObjectAiming(args.object_id, robot, points, document))

    @rpc("ObjectAimingAddPoint")
    async def object_aiming_add_point(
        self, context: Context, args: ObjectAimingAddPointArgs
    ) -> ObjectAimingAddPointData:
        """Use the present position of the tool tip for a focus point; return the indices of all touched points."""
        document = self._session.require_scene_open()
        aiming = self._object_aiming.require(context.user, document)
        robot = aiming.robot
        self._editing.require_locked(context, aiming.object_id)
        self._editing.require_locked(context, robot.robot_id)
        if not 0 <= args.point_idx < len(aiming.points):
            raise RequestRefused(
                "Focus point {point_idx} does not exist. Use 0 to {count}.",
                point_idx=args.point_idx,
                count=len(aiming.points) - 1,
            )
        pose = await self._online.end_effector_pose(robot.robot_id, robot.end_effector, optional(robot.arm_id))
        if context.dry_run:
            return ObjectAimingAddPointData(sorted({*aiming.poses, args.point_idx}))
        aiming.poses[args.point_idx] = pose
        return ObjectAimingAddPointData(sorted(aiming.poses))

    @rpc("ObjectAimingDone")
    async def object_aiming_done(self, context: Context, args: None) -> None:
        """Set the pose of the object from the touched points. The user keeps the locks."""
        document = self._session.require_scene_open()
        user = context.user
        aiming = self._object_aiming.require(user, document)
        if missing := [index for index in range(len(aiming.points)) if index not in aiming.poses]:
            raise RequestRefused("Focus points are missing: {missing}.", missing=", ".join(map(str, missing)))
        obj = document.scene_object(aiming.object_id)
        touched = [aiming.poses[index].position for index in range(len(aiming.points))]
        found = fit([point.position for point in aiming.points], touched)
        log.info("pose found by touched points", object=obj.name, largest_deviation_m=found.worst)
        if found.worst > WORST_MISS:
            raise RequestRefused(
                "The touched points do not fit {name}: one is off by {worst:.0f} mm. Touch the focus points again.",
                name=obj.name,
                worst=found.worst * 1000,
            )
        await self._scene_object_requests.move_object(context, obj, found.pose)
        if not context.dry_run:
            self._object_aiming.end(user)

    @rpc("ObjectAimingCancel")
    async def object_aiming_cancel(self, context: Context, args: None) -> None:
        """Stop aiming and discard the touched points."""
        user = context.user
        self._object_aiming.require(user, self._session.document)
        if not context.dry_run:
            self._object_aiming.end(user)
