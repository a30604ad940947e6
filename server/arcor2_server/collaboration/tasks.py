"""Long-running tasks: their progress and outcome."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import new_id, now
from arcor2_hw.data.editor import TaskKind, TaskProgress, TaskStateData
from arcor2_hw.data.events import Event
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_server.collaboration.throttle import Throttle
from arcor2_server.events import EventHub, encode, make_event

PERIOD: Final = 0.1
"""Minimum time between two events of one task, s."""
NAME: Final = "TaskState"


class Task:
    """One task. Updates after its end are ignored."""

    def __init__(self, tasks: "Tasks", state: TaskStateData) -> None:
        self._tasks = tasks
        self.state = state

    def at(self, progress: float | None, message: str | Message = "") -> None:
        """Report the progress, 0 to 1 (None: unknown), and the present step."""
        share = UNSET if progress is None else min(max(progress, 0.0), 1.0)
        if not message:
            self._tasks._update(self, replace(self.state, progress=share))
            return
        message = message if isinstance(message, Message) else Message.of(message)
        fields = {"key": UNSET, "values": UNSET} | message.translation()
        self._tasks._update(self, replace(self.state, progress=share, message=message.text, **fields))

    def finish(self, message: str | Message | None = None) -> None:
        """End the task as finished."""
        self._end(TaskProgress.FINISHED, message)

    def fail(self, message: str | Message) -> None:
        """End the task as failed; `message` is the reason."""
        self._end(TaskProgress.FAILED, message)

    def cancel(self, message: str | Message | None = None) -> None:
        """End the task as cancelled."""
        self._end(TaskProgress.CANCELLED, message)

    def _end(self, how: TaskProgress, message: str | Message | None) -> None:
        progress: Any = 1.0 if how is TaskProgress.FINISHED else self.state.progress
        translation: dict[str, Any] = {"key": UNSET, "values": UNSET}
        translation |= message.translation() if isinstance(message, Message) else {}
        text = str(message) if message else UNSET
        self._tasks._update(self, replace(self.state, state=how, progress=progress, message=text, **translation))


class Tasks:
    """The running tasks. Changes are published to the subscribers of TaskState."""

    def __init__(self, hub: EventHub) -> None:
        self._hub = hub
        self._running: dict[str, Task] = {}
        self._events = Throttle(PERIOD, lambda key, event: hub.stream_to_subscribers(NAME, key, event))

    def begin(self, kind: TaskKind, title: Message, started_by: str | None = None) -> Task:
        """Start a task. `title` is a sentence without a full stop."""
        state = TaskStateData(
            new_id("task"), kind, title.text, TaskProgress.RUNNING, now(), started_by or UNSET, title_message=title
        )
        task = self._running[state.id] = Task(self, state)
        self._events.put(state.id, encode(make_event(NAME, state)))
        return task

    @contextmanager
    def running(self, kind: TaskKind, title: Message, started_by: str | None = None) -> Iterator[Task]:
        """Show the enclosed block as a task. If the block raises an error, the task fails with it."""
        task = self.begin(kind, title, started_by)
        try:
            yield task
        except asyncio.CancelledError:
            task.cancel()
            raise
        except BaseException as error:
            task.fail(error.message if isinstance(error, Arcor2Error) else "An error inside the server.")
            raise
        task.finish()

    def running_events(self) -> list[Event]:
        """Return the events that describe all running tasks."""
        return [make_event(NAME, task.state) for task in self._running.values()]

    def close(self) -> None:
        """Cancel the pending events."""
        self._events.close()

    def _update(self, task: Task, state: TaskStateData) -> None:
        if state.id not in self._running:
            return
        task.state = state
        event = encode(make_event(NAME, state))
        if state.state is TaskProgress.RUNNING:
            self._events.put(state.id, event)
        else:
            del self._running[state.id]
            self._events.end(state.id, event)
