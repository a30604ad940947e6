"""The hold of the running program: its publication, decisions, and their record."""

import asyncio
import time
from collections.abc import Mapping
from typing import Final

import structlog
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.held import ActionHold, HeldData, HoldChoice, HoldDecidedData
from arcor2_hw.data.object_type import Again
from arcor2_hw.data.rpc import DecideHeldArgs
from arcor2_hw.messages import Message, translatable
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.execution.runs import Runs
from arcor2_server.hosts.group import HostGroup

log = structlog.get_logger(__name__)

HELD: Final = "Held"
"""The additional event with the action at which the program is held."""
DECIDED: Final = "HoldDecided"
"""The additional event with the decision."""
_CHOICES: Final[Mapping[HoldChoice, str]] = translatable(
    {
        HoldChoice.RETRY: "try again",
        HoldChoice.RESULT: "enter the result",
        HoldChoice.SKIP: "done by hand",
        HoldChoice.ERROR_EXIT: "take the error exit",
        HoldChoice.END: "end the program",
    }
)


def _name(choice: HoldChoice) -> Message:
    return Message.of(_CHOICES[choice])


class ProgramHold:
    """The hold of the present run, if there is one.

    Args:
        hub: publishes it.
        runs: records it in the trace of the run.
    """

    def __init__(self, hub: EventHub, runs: Runs) -> None:
        self._hub, self._runs = hub, runs
        self.present: HeldData | None = None
        self.seconds = 0.0
        """Time for which the present run was held, s."""
        self._record: ActionHold | None = None
        self._began = 0.0
        self._last: HoldDecidedData | None = None
        self._deciding = asyncio.Lock()

    def reset(self) -> None:
        """Discard the holds of the previous run."""
        self.present, self._record, self._last, self.seconds = None, None, None, 0.0

    @property
    def ended_program(self) -> bool:
        """Whether a person has decided to end the present run, so that its error is known already."""
        return self._last is not None and self._last.choice is HoldChoice.END

    def begin(self, run: int, held: HeldData) -> None:
        """Handle the start of a hold."""
        self.present = replace(held, run=run)
        self._last = None  # an action before which the program was held may fail afterwards
        self._began = time.monotonic()
        self._record = ActionHold(held.since)
        self._runs.set_hold(held.number, self._record)
        log.warning("program held", run=run, action=held.action_name, device=held.device, reason=held.text)
        self._hub.broadcast(make_event(HELD, self.present))

    def change(self, held: HeldData) -> None:
        """Handle changed choices of the present hold."""
        if self.present is not None and self.present.number == held.number:
            self.present = replace(held, run=self.present.run)
            self._hub.broadcast(make_event(HELD, self.present))

    def end(self) -> HoldDecidedData | None:
        """Handle the end of a hold. Return the decision; None if the program was stopped."""
        if self._record is None or self.present is None:
            return None
        duration = time.monotonic() - self._began
        self.seconds += duration
        self._runs.set_hold(self.present.number, replace(self._record, duration=round(duration, 3)))
        decided = self._last if self._last is not None and self._last.number == self.present.number else None
        if decided is not None:
            log.warning("held program continues", number=decided.number, choice=decided.choice.value, by=decided.by)
            self._hub.broadcast(make_event(DECIDED, decided))
        self.present, self._record = None, None
        return decided

    def require_none(self) -> None:
        """Raise RequestRefused, with the choices, while the program is held."""
        held = self.present
        if held is None:
            return
        choices = Message.listed([_name(choice) for choice in held.choices])
        raise RequestRefused(
            "The program is held at {action}, and needs a decision: {choices}. Decide in the editor, or stop it.",
            action=held.action_name,
            choices=choices,
        )

    async def decide(self, host: HostGroup | None, args: DecideHeldArgs, by: str) -> None:
        """Continue the held program. The first decision counts.

        Raises:
            RequestRefused: the program is not held at this action, or the decision is not possible.
            Arcor2Error: the host refuses the decision.
        """
        async with self._deciding:
            held = self._require(args.number)
            if host is None or args.choice not in held.choices:
                choices = Message.listed([_name(choice) for choice in held.choices])
                raise RequestRefused("This decision is not possible here. Choices: {choices}.", choices=choices)
            if args.choice is HoldChoice.RETRY and held.again is Again.ASK and not args.confirmed:
                raise RequestRefused(
                    "{action} may have been executed partly. Confirm that it is to be repeated.",
                    action=held.action_name,
                )
            self._last = HoldDecidedData(held.run, held.number, args.choice, by)
            record, self._record = (
                self._record,
                None if self._record is None else replace(self._record, choice=args.choice, by=by or UNSET),
            )
            results = [] if isinstance(args.results, Unset) else args.results
            exit_id = "" if isinstance(args.exit_id, Unset) else args.exit_id
            try:
                await host.decide(held.number, args.choice, results, exit_id)
            except BaseException:
                self._record, self._last = record, None
                raise

    def _require(self, number: int) -> HeldData:
        """Return the hold at an action. Raise RequestRefused if there is none, naming an earlier decision."""
        held, last = self.present, self._last
        if last is not None and last.number == number:
            raise RequestRefused("{user} has already decided: {choice}.", user=last.by or "Another client",
                                 choice=_name(last.choice))  # fmt: skip
        if held is None or held.number != number:
            raise RequestRefused("The program is not held at this action.")
        return held
