"""Shows the start and stop of a scene as a task."""

from arcor2_hw.data.device import Connection
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.events import ObjectStateData, SceneStateEnum
from arcor2_server.collaboration.tasks import Task, Tasks

_UP = frozenset({Connection.ONLINE, Connection.BACK})


class SceneTask:
    """Follows the states of the scene, and the connections of its objects during the start."""

    def __init__(self, tasks: Tasks) -> None:
        self._tasks = tasks
        self._task: Task | None = None
        self._starting = False
        self.asked_by = ""
        """The user who last started or stopped the scene."""

    def entered(self, state: SceneStateEnum, scene: str, message: str) -> None:
        """Show that the scene has entered a state, with the reason `message`."""
        task = self._task
        match state:
            case SceneStateEnum.STARTING:
                self._starting = True
                self._task = self._tasks.begin(TaskKind.SCENE_START, f"Starting the scene {scene}", self.asked_by)
            case SceneStateEnum.STOPPING:
                if task is not None:  # it did not come up: what can be closed is closed
                    task.fail(message or "The scene did not come up.")
                self._starting = False
                self._task = self._tasks.begin(TaskKind.SCENE_STOP, f"Stopping the scene {scene}", self.asked_by)
            case SceneStateEnum.STARTED | SceneStateEnum.STOPPED if task is not None:
                task.finish(message)
                self._task = None
                self._starting = False
            case _:
                pass

    def connected(self, states: list[ObjectStateData]) -> None:
        """Return how many of the scene's objects are connected."""
        if self._task is None or not self._starting or not states:
            return
        up = sum(state.state in _UP for state in states)
        self._task.at(up / len(states), f"{up} of {len(states)} objects are connected.")
