"""Reports the start and stop of a scene as a task."""

from arcor2_hw.data.device import Connection
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.events import ObjectStateData, SceneStateEnum
from arcor2_hw.messages import Message
from arcor2_server.collaboration.tasks import Task, Tasks

_CONNECTED = frozenset({Connection.ONLINE, Connection.BACK})


class SceneTask:
    """The task of the start or stop of the scene, with the number of connected objects."""

    def __init__(self, tasks: Tasks) -> None:
        self._tasks = tasks
        self._task: Task | None = None
        self._starting = False

    def entered(self, state: SceneStateEnum, scene: str, message: Message | None, by: str) -> None:
        """Start or end the task after the scene has entered a state.

        Args:
            state: the state.
            scene: name of the scene.
            message: the reason.
            by: the user who last started or stopped the scene.
        """
        task = self._task
        match state:
            case SceneStateEnum.STARTING:
                self._starting = True
                self._task = self._tasks.begin(
                    TaskKind.SCENE_START, Message.of("Starting the scene {name}", name=scene), by
                )
            case SceneStateEnum.STOPPING:
                if task is not None:  # the start failed
                    task.fail(message or Message.of("The scene could not be started."))
                self._starting = False
                self._task = self._tasks.begin(
                    TaskKind.SCENE_STOP, Message.of("Stopping the scene {name}", name=scene), by
                )
            case SceneStateEnum.STARTED | SceneStateEnum.STOPPED if task is not None:
                task.finish(message)
                self._task = None
                self._starting = False
            case _:
                pass

    def connected(self, states: list[ObjectStateData]) -> None:
        """Report the number of connected objects."""
        if self._task is None or not self._starting or not states:
            return
        connected = sum(state.state in _CONNECTED for state in states)
        self._task.at(
            connected / len(states),
            Message.of("{count} of {all} objects are connected.", count=connected, all=len(states)),
        )
