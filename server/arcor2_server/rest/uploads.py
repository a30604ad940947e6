"""Reports the progress of an upload over REST as a task."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from litestar import Request
from litestar.exceptions import HTTPException

from arcor2_hw.data.editor import TaskKind
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message
from arcor2_server.access.route_options import PERSON
from arcor2_server.collaboration.tasks import Task, Tasks

RECEIVED: Final = 0.9
"""Progress of the task when all data is received. Then the data is checked and stored."""


@contextmanager
def receiving(request: Request[Any, Any, Any], tasks: Tasks, title: str, shown_from: int) -> Iterator[None]:
    """Report the upload in the body of the `with` statement as a task.

    Args:
        request: the request.
        tasks: the tasks.
        title: title of the task, in which `{name}` is a part of the path; no task is reported if it is empty.
        shown_from: size of the request below which no task is reported, bytes.
    """
    size = request.content_length
    if not title or (size is not None and size < shown_from):
        yield
        return
    task = tasks.begin(TaskKind.UPLOAD, Message.of(title, **request.path_params), request.state.get(PERSON, ""))
    _count(request, task, size)
    try:
        yield
    except asyncio.CancelledError:
        task.cancel()
        raise
    except Arcor2Error as error:
        task.fail(error.message)
        raise
    except HTTPException as error:  # for example, the body is too large
        task.fail(error.detail)
        raise
    except BaseException:
        task.fail("An error inside the server.")
        raise
    task.finish()


def _count(request: Request[Any, Any, Any], task: Task, size: int | None) -> None:
    """Update the progress of the task from the received data."""
    receive, received = request.receive, 0

    async def counted() -> Any:
        nonlocal received
        message: Any = await receive()
        if message["type"] == "http.request":
            received += len(message.get("body", b""))
            if not message.get("more_body", False):
                task.at(RECEIVED if size else None, Message.of("All data is received. Checking and storing it."))
            elif size:
                text = "{received:.1f} of {size:.1f} MB received."
                task.at(RECEIVED * received / size, Message.of(text, received=received / 1e6, size=size / 1e6))
            else:
                task.at(None, Message.of("{received:.1f} MB received.", received=received / 1e6))
        elif message["type"] == "http.disconnect":
            task.cancel(Message.of("The client disconnected after {received:.1f} MB.", received=received / 1e6))
        return message

    request.receive = counted
