"""Resources: the objects and action points that the script of a package uses."""

import contextlib
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast, overload

from arcor2_hw.data.events import PackageInfoData
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import ActionPoint, Project, ProjectRobotJoints
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import Arcor2Error, ProgramFinished, ProgramStopped
from arcor2_hw.objects import Generic
from arcor2_hw.runtime.cell import SceneFault
from arcor2_hw.runtime.creation import prepare_for_sources
from arcor2_hw.runtime.functions import F, function_of
from arcor2_hw.runtime.package import PackageData, WorldPoints, package_name, package_recipes
from arcor2_hw.runtime.parallel import run_parallel
from arcor2_hw.runtime.program import ActionError, Program, current
from arcor2_hw.runtime.proxy import proxy
from arcor2_hw.runtime.retrying import Retrying
from arcor2_hw.runtime.standalone import Standalone

T = TypeVar("T", bound=Generic)
A = TypeVar("A")
B = TypeVar("B")
C = TypeVar("C")
D = TypeVar("D")

# A script that is run by hand imports this module first and then its object types, before it uses this module.
prepare_for_sources()


class Resources:
    """The objects of the scene by id, and the action points in world coordinates.

    Entering the context creates and connects the objects, takes control of the devices and publishes PackageInfo.
    Leaving it closes the devices. A program that was stopped, or finished by a flow action, leaves the context without
    an exception.

    Raises:
        InvalidPackage: A document of the package cannot be read.
        NotFound: The project refers to something that does not exist.
        InvalidData: A value in the scene or project is not valid.
        Arcor2Error: A device cannot be connected.
    """

    def __init__(self) -> None:
        program = current()
        self._standalone: Standalone | None = None
        if program is None:
            self._standalone = Standalone()
            program = self._standalone.program
        self._program: Program = program
        self._directory = Path.cwd() if self._standalone is None else self._standalone.directory
        self.objects: dict[str, Any] = {}
        """Proxies of the devices by id of the scene object. Typed Any, because the script annotates each of them."""
        data = PackageData(self._directory, program.values)
        self._data = data
        self._points = WorldPoints(data.scene, data.project)
        program.load(data.project)

    # -------------------------------------------------------------------------------- data
    @property
    def scene(self) -> Scene:
        """Return the scene of the package."""
        return self._data.scene

    @property
    def project(self) -> Project:
        """Return the project of the package; its action points are relative to their parents."""
        return self._data.project

    def action_point(self, action_point_id: str) -> ActionPoint:
        """Return an action point with its position in world coordinates. Raises NotFound."""
        return self._points.bare_action_point(action_point_id)

    def position(self, action_point_id: str) -> Position:
        """Return a copy of the position of an action point in world coordinates. Raises NotFound."""
        return self._points.position(action_point_id)

    def pose(self, orientation_id: str) -> Pose:
        """Return a copy of the world pose of an action point with this orientation. Raises NotFound."""
        return self._points.pose(orientation_id)

    def joints(self, joints_id: str) -> ProjectRobotJoints:
        """Return a copy of a joint configuration of an action point. Raises NotFound."""
        return self._points.joints(joints_id)

    def parameter(self, parameter_id: str) -> Any:
        """Return the value of a project parameter. Raises NotFound."""
        return self._points.parameter(parameter_id)

    def caught(self, error: Arcor2Error) -> ActionError:
        """Return device, kind and text of the error of an action. Raises errors that always end the program."""
        return self._program.caught(error)

    def retry(self, device: T, count: int, *, pause: float = 0.0) -> T:
        """Return a device whose actions are repeated after they have failed: `res.retry(reader, 3).scan(an="scan")`.

        Args:
            device: the device.
            count: maximum number of repetitions.
            pause: time before each repetition, s.

        Raises:
            InvalidData: an action is used that its driver does not declare safe to repeat.
        """
        return cast("T", Retrying(device, self._program, count, pause))

    def function(self, body: F) -> F:
        """Let calls of a function of the script be announced, stepped into and traced: the decorator of functions."""
        return function_of(self._program, body)

    @overload
    def parallel(self, a: Callable[[], A], b: Callable[[], B], /, *, an: str | None = None) -> tuple[A, B]: ...
    @overload
    def parallel(
        self, a: Callable[[], A], b: Callable[[], B], c: Callable[[], C], /, *, an: str | None = None
    ) -> tuple[A, B, C]: ...
    @overload
    def parallel(
        self,
        a: Callable[[], A],
        b: Callable[[], B],
        c: Callable[[], C],
        d: Callable[[], D],
        /,
        *,
        an: str | None = None,
    ) -> tuple[A, B, C, D]: ...
    def parallel(self, *calls: Callable[[], Any], an: str | None = None) -> tuple[Any, ...]:
        """Run two to four calls of functions concurrently, wait until all have ended, and return their results.

        If one fails, the devices of the others are stopped, and the others end at their next action. Then the error
        that came first is raised.

        Args:
            calls: the calls, such as `lambda: fetch(3, an="fetch")`.
            an: name of the action.

        Raises:
            InvalidData: the number of calls is wrong, or this call is a branch of parallel work.
        """
        return run_parallel(self._program, calls, an)

    # -------------------------------------------------------------------------------- life
    def __enter__(self) -> "Resources":
        program = self._program
        program.inside = True
        try:
            if self._standalone is not None:
                self._standalone.start()
            self._open()
        except BaseException:
            self._close(True)
            raise
        finally:
            program.inside = False
        return self

    def _open(self) -> None:
        program, data = self._program, self._data
        program.check()
        try:
            program.cell.open(
                package_recipes(
                    self._directory, data, program.cell_file, program.secrets, data.scene.objects, program.remotes
                )
            )
            program.interlocks.configure(data.scene.interlocks)
            program.check()
            program.cell.require_confirmed()
            program.take_control()
        except SceneFault as fault:
            with contextlib.suppress(Arcor2Error):  # the object has no instance
                program.record_error_source(program.cell[fault.object_id], fault.error)
            raise fault.error from fault
        if program.record is not None:
            program.record.open(data.project, program.cell, self._directory)
        for device in program.cell:
            self.objects[device.id] = proxy(device, program)
        name = package_name(self._directory, program.package_id)
        program.started(PackageInfoData(program.package_id, name, data.scene, data.project, data.collision_models()))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: types.TracebackType | None
    ) -> bool:
        self._program.ended = True
        failed = error is not None and not isinstance(error, ProgramFinished)
        problem = self._close(failed)
        if problem is not None and error is None:
            raise problem
        return isinstance(error, ProgramFinished | ProgramStopped)

    def _close(self, failed: bool) -> Arcor2Error | None:
        """Close the devices of a standalone script. After a failure, stop all devices first."""
        self._program.ended = True
        problem = self._program.settle(failed)
        if self._standalone is not None:
            self._program.interlocks.close()
            problem = self._program.cell.close() or problem
            self._standalone.end()
        return problem
