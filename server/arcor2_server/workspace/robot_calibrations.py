"""Kinematic calibrations read from robot controllers, used for computations also offline.

A calibration is read whenever a robot that provides one connects in an online scene. It is stored for the object and
for the address of its device, since another address may be another robot.
"""

import asyncio
import enum
import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import msgspec
import structlog

from arcor2_hw.collision.description import RobotSource
from arcor2_hw.compute.kinematics_tasks import DescribeRobot
from arcor2_hw.data.base import Data, Timestamp, now
from arcor2_hw.data.device import Connection
from arcor2_hw.data.events import NotificationData, NotificationLevel
from arcor2_hw.data.robot import KinematicCalibration
from arcor2_hw.data.scene import SceneObject, SceneObjectOverride
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.messages import Message
from arcor2_server.background import BackgroundTasks
from arcor2_server.compute.workers import Compute
from arcor2_server.documents import Session
from arcor2_server.events import EventHub, make_event
from arcor2_server.files import write_private
from arcor2_server.hosts.session import HostSession
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.workspace.robots import SceneRobots

log = structlog.get_logger(__name__)

MAX_CALIBRATIONS: Final = 1000
"""Maximum number of stored calibrations; the oldest are dropped."""
_CONNECTED: Final = (Connection.ONLINE, Connection.BACK)


class RobotCalibration(Data, frozen=True):
    """A calibration read from a robot controller.

    Attributes:
        object_id: The id of the robot.
        name: The name of the robot.
        device: Identifies the device by the settings of the robot.
        read: Time at which the calibration was read.
        calibration: The calibration.
        refused: Reason why the calibration is not used, empty if it is used. Older versions stored the English text.
    """

    object_id: str
    name: str
    device: str
    read: Timestamp
    calibration: KinematicCalibration
    refused: Message | str = ""


class ActiveKinematics(enum.StrEnum):
    """The origin of the kinematics of a robot."""

    NONE = "none"
    """The robot has no model."""
    NOMINAL = "nominal"
    """Nominal for its type: the error at the tip may be some millimetres."""
    MEASURED = "measured"
    """Calibrated for this robot, read from its controller."""


@dataclass(eq=False, slots=True)
class RobotCalibrations:
    """The stored calibrations, for use on one event loop."""

    _settings: ServerSettings
    _hub: EventHub
    _types: ObjectTypes
    _session: Session
    _host: HostSession
    _compute: Compute
    _damage: DataDamage
    _robots: SceneRobots
    _stored: dict[str, RobotCalibration] = field(init=False, default_factory=dict)
    """By the object's id."""
    _asked: set[str] = field(init=False, default_factory=set)
    """Robots whose calibration was requested since they connected."""
    _reading: BackgroundTasks = field(init=False, default_factory=BackgroundTasks)
    _writing: asyncio.Lock = field(init=False, default_factory=asyncio.Lock)
    on_change: list[Callable[[SceneObject], None]] = field(init=False, default_factory=list)
    """Called with a robot whose calibration in use changed."""

    @property
    def any(self) -> bool:
        """Return whether any calibrations are stored."""
        return bool(self._stored)

    def load(self) -> None:
        """Read the stored calibrations; report a damaged file. Raise StorageError if it cannot be read."""
        loss = Message.of("Kinematics are nominal until each robot is connected again.")
        stored = self._damage.read_json(self._settings.arm_calibrations_file, list[RobotCalibration], loss) or []
        self._stored = {each.object_id: each for each in stored}

    def stored(self, robot: SceneObject, overrides: list[SceneObjectOverride] | None = None) -> RobotCalibration | None:
        """Return the stored calibration of a robot, used or not; None if there is none.

        `overrides` are those of the project that the robot is used in; None for the open project.
        """
        found = self._stored.get(robot.id)
        return found if found is not None and found.device == self._device(robot, overrides) else None

    def in_force(
        self, robot: SceneObject, overrides: list[SceneObjectOverride] | None = None
    ) -> KinematicCalibration | None:
        """Return the calibration in use for a robot, None if its kinematics are nominal. Arguments as of `stored`."""
        found = self.stored(robot, overrides)
        return None if found is None or found.refused else found.calibration

    def read_connected(self) -> None:
        """Read the calibrations of newly connected robots, when a connection or the state of the scene changes."""
        if not self._host.online:
            self._asked.clear()
            return
        connected = {state.object_id for state in self._host.board.states() if state.state in _CONNECTED}
        self._asked &= connected
        for robot in self._session.require_scene().objects:
            if robot.id in connected - self._asked and self._is_readable(robot):
                self._asked.add(robot.id)
                self._reading.spawn(self._read(robot), f"kinematics of {robot.name}")

    async def settled(self) -> None:
        """Wait for the pending reads."""
        await self._reading.settled()

    async def close(self) -> None:
        """Cancel the pending reads."""
        await self._reading.cancel()

    # ------------------------------------------------------------------------------------------------ internals
    def _is_readable(self, robot: SceneObject) -> bool:
        types = self._types
        if not types.derives_from(robot.type, "Robot") or self._robots.model_of_type(robot.type) is None:
            return False
        meta = types.robot_meta(robot.type)
        return meta.features.kinematic_calibration is True and not meta.multi_arm

    def _device(self, robot: SceneObject, overrides: list[SceneObjectOverride] | None = None) -> str:
        """Return an identifier of the robot's device, computed from its settings that are texts or integers."""
        settings = self._robots.settings_of(robot, overrides)
        cell = self._settings.cell
        here = None if cell is None else cell.device(robot.name)
        if here is not None and here.type == robot.type:
            settings |= here.settings
        where = {key: value for key, value in settings.items() if type(value) in (str, int)}
        encoded = msgspec.json.encode((robot.type, where), order="sorted")
        return hashlib.sha256(encoded).hexdigest()[:32]

    async def _read(self, robot: SceneObject) -> None:
        try:
            calibration = await self._host.ask(KinematicCalibration, robot.id, "kinematic_calibration")
        except Arcor2Error as error:
            if self._host.online:
                log.warning("kinematic calibration cannot be read", robot=robot.name, reason=str(error))
                text = (
                    "{robot}: The calibration cannot be read from the controller. The stored one is used. {reason}"
                    if self.in_force(robot)
                    else "{robot}: The calibration cannot be read from the controller. "
                    "Nominal kinematics are used. {reason}"
                )
                self._publish(Message.of(text, robot=robot.name, reason=error))
            return
        before = self.stored(robot)
        refusal = await self._refused(robot, calibration)
        found = RobotCalibration(robot.id, robot.name, self._device(robot), now(), calibration, refusal or "")
        same = before is not None and (before.calibration, before.refused) == (calibration, found.refused)
        self._stored.pop(robot.id, None)
        self._stored[robot.id] = found
        while len(self._stored) > MAX_CALIBRATIONS:
            del self._stored[next(iter(self._stored))]
        log.info(
            "kinematic calibration read",
            robot=robot.name,
            checksum=calibration.checksum,
            refused=str(found.refused),
            same=same,
        )
        await self._save()
        if same:
            return
        for notify in self.on_change:
            notify(robot)
        if refusal is not None:
            text = "{robot}: The calibration in the controller cannot be used. Kinematics are nominal. {reason}"
            self._publish(Message.of(text, robot=robot.name, reason=refusal))
        else:
            used = "{robot}: The calibration in the controller is now used."
            self._publish(Message.of(used, robot=robot.name), bad=False)

    async def _refused(self, robot: SceneObject, calibration: KinematicCalibration) -> Message | None:
        """Return the reason why a calibration cannot be used, None if it can."""
        file = self._robots.model_of_type(robot.type)
        if file is None:
            return Message.of("{name} has no model (URDF).", name=robot.name)
        settings = self._robots.settings_of(robot)
        try:
            await self._compute.run(DescribeRobot(RobotSource(file, settings=settings, calibration=calibration)))
        except InvalidData as error:
            return error.message
        except Arcor2Error as error:  # reported again when the calibration is used
            log.warning("kinematic calibration not checked", robot=robot.name, reason=str(error))
        return None

    def _publish(self, message: Message, *, bad: bool = True) -> None:
        """Notify all clients of the kinematics used for a robot, and the reason."""
        level = NotificationLevel.WARN if bad else NotificationLevel.INFO
        data = NotificationData(message.text, level, **message.translation())
        self._hub.broadcast(make_event("Notification", data))

    async def _save(self) -> None:
        async with self._writing:
            content = msgspec.json.format(msgspec.json.encode(list(self._stored.values())))
            try:
                await asyncio.to_thread(write_private, self._settings.arm_calibrations_file, content)
            except OSError as error:
                log.error(
                    "kinematic calibrations cannot be stored",
                    file=str(self._settings.arm_calibrations_file),
                    reason=str(error),
                )
