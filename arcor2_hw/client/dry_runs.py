"""Starts a dry run of the open project and waits for its result."""

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from typing import Final

from msgspec import UNSET

from arcor2_hw.client.connection import Client
from arcor2_hw.client.errors import EventsMissed
from arcor2_hw.data.base import Unset
from arcor2_hw.data.dry_run import DryRunState
from arcor2_hw.data.editor import TaskKind, TaskStateData
from arcor2_hw.data.rpc import GetDryRunData
from arcor2_hw.exceptions import Arcor2Error, Cancelled

PERIOD: Final = 5.0
"""Time after which the state is requested without an event, s."""


class DryRunFailed(Arcor2Error):
    """The dry run could not be computed."""

    code = "dry_run_failed"


async def dry_run(
    client: Client,
    *,
    from_action: str | None = None,
    branches: Mapping[str, str] | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> GetDryRunData:
    """Predict the times of one cycle of the open project.

    If the caller is cancelled, so is the dry run.

    Args:
        client: An open client.
        from_action: Id of the first action; default: the one after START.
        branches: For actions with several branches, the id of the next action, or END, by the id of the action.
        on_progress: Receives the progress, 0 to 1.

    Raises:
        DryRunFailed: It could not be computed; the message states the reason.
        Cancelled: A client cancelled it.
        RequestFailed: The server refused it.
    """
    await client.subscribe_events(events={"DryRunChanged", "TaskState"})
    with client.follow("DryRunChanged", "TaskState") as events:
        head = await client.start_dry_run(
            from_action=UNSET if from_action is None else from_action,
            branches=UNSET if branches is None else dict(branches),
        )
        try:
            while True:
                found = await client.get_dry_run(number=head.number)
                match found.dry_run.state:
                    case DryRunState.FINISHED:
                        return found
                    case DryRunState.CANCELLED:
                        raise Cancelled("The dry run was cancelled.")
                    case DryRunState.FAILED:
                        error = found.dry_run.error
                        text = "" if isinstance(error, Unset) else error
                        raise DryRunFailed(found.dry_run.as_message(text))
                with contextlib.suppress(TimeoutError, EventsMissed):
                    async with asyncio.timeout(PERIOD):
                        async for event in events:
                            if not isinstance(task := event.data, TaskStateData):
                                break
                            computes = task.kind is TaskKind.COMPUTATION
                            if on_progress and computes and not isinstance(task.progress, Unset):
                                on_progress(task.progress)
        except asyncio.CancelledError:
            with contextlib.suppress(Arcor2Error):
                await client.cancel_dry_run()
            raise
