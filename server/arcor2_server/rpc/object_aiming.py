"""Requests that determine the pose of an object by touching its focus points with a robot (protocol, 7.3)."""

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

log = structlog.get_logger(__name__)

WORST_MISS: Final = 0.05
"""By how much a touched point may miss, m; beyond that it was another point that was touched."""


class ObjectAimingRequests:
    """Requests by which a robot shows where an object stands."""

    def __init__(
        self,
        types: ObjectTypes,
        session: Session,
        online: OnlineScene,
        object_aiming: ObjectAimings,
        editing: Editing,
        scene_object_requests: SceneObjectRequests,
    ) -> None:
        self._types = types
        self._session = session
        self._online = online
        self._object_aiming = object_aiming
        self._editing = editing
        self._scene_object_requests = scene_object_requests

    def _focus_points(self, context: Context, obj: SceneObject) -> list[Pose]:
        """Return the focus points of an object's mesh; RequestRefused, InvalidData when it cannot be aimed at."""
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
        """Begin to aim at an object with a robot."""
        robot = args.robot
        document = self._session.require_scene_alone()
        self._online.require_online()
        user = context.user
        if self._object_aiming.of(user, document) is not None:
            raise RequestRefused("You are aiming already: finish that, or cancel it.")
        points = self._focus_points(context, document.scene_object(args.object_id))
        self._online.robot(robot.robot_id)
        self._editing.require_held(context, args.object_id)
        self._editing.require_held(context, robot.robot_id)
        # Tells whether the robot has that arm and end effector, and knows where it is.
        await self._editing.eef_pose(context, robot.robot_id, robot.end_effector, robot.arm_id)
        if self._object_aiming.of(user, self._session.require_scene_alone()) is not None:
            raise RequestRefused("You are aiming already: finish that, or cancel it.")
        if not context.dry_run:
            self._object_aiming.begin(user, ObjectAiming(args.object_id, robot, points, document))

    @rpc("ObjectAimingAddPoint")
    async def object_aiming_add_point(
        self, context: Context, args: ObjectAimingAddPointArgs
    ) -> ObjectAimingAddPointData:
        """Use the present position of the tip for a focus point; return the finished points."""
        document = self._session.require_scene_open()
        aiming = self._object_aiming.require(context.user, document)
        self._editing.require_held(context, aiming.object_id)
        self._editing.require_held(context, aiming.robot.robot_id)
        if not 0 <= args.point_idx < len(aiming.points):
            raise RequestRefused(
                "Focus point {point_idx} does not exist. Use 0 to {count}.",
                point_idx=args.point_idx,
                count=len(aiming.points) - 1,
            )
        pose = await self._editing.eef_pose(
            context, aiming.robot.robot_id, aiming.robot.end_effector, aiming.robot.arm_id
        )
        if context.dry_run:
            return ObjectAimingAddPointData(sorted({*aiming.poses, args.point_idx}))
        aiming.poses[args.point_idx] = pose
        return ObjectAimingAddPointData(sorted(aiming.poses))

    @rpc("ObjectAimingDone")
    async def object_aiming_done(self, context: Context, args: None) -> None:
        """Put the object where the robot found its focus points. The locks stay with the user."""
        document = self._session.require_scene_open()
        user = context.user
        aiming = self._object_aiming.require(user, document)
        if missing := [index for index in range(len(aiming.points)) if index not in aiming.poses]:
            raise RequestRefused("Focus points are missing: {missing}.", missing=", ".join(map(str, missing)))
        obj = document.scene_object(aiming.object_id)
        touched = [aiming.poses[index].position for index in range(len(aiming.points))]
        found = fit([point.position for point in aiming.points], touched)
        log.info("aimed", object=obj.name, worst=found.worst)
        if found.worst > WORST_MISS:
            raise RequestRefused(
                "The points do not fit {name}: one misses by {worst:.0f} mm. Was another one touched?",
                name=obj.name,
                worst=found.worst * 1000,
            )
        await self._scene_object_requests.move_object(context, obj, found.pose)
        if not context.dry_run:
            self._object_aiming.end(user)

    @rpc("ObjectAimingCancel")
    async def object_aiming_cancel(self, context: Context, args: None) -> None:
        """Stop aiming; what was found is forgotten."""
        user = context.user
        self._object_aiming.require(user, self._session.document)
        if not context.dry_run:
            self._object_aiming.end(user)
