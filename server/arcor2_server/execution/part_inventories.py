"""Part inventories of all scenes: their publication, state after an interruption, and corrections by people."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Final

import msgspec
import structlog
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.parts import PartInventory, PlaceKind, Restart, RunCheckpoint
from arcor2_hw.data.position import MAIN_BRANCH
from arcor2_hw.data.rpc import ConfirmPartsArgs
from arcor2_hw.messages import Message
from arcor2_hw.runtime.checkpoints import CheckpointFile, stored_scenes
from arcor2_hw.runtime.ledger import Ledger
from arcor2_server.errors import RequestRefused
from arcor2_server.events import EventHub, make_event
from arcor2_server.hosts.group import HostGroup

log = structlog.get_logger(__name__)

PARTS: Final = "PartsChanged"
"""The additional event with the inventory of a scene."""


class _SceneId(msgspec.Struct):
    id: str


class PartInventories:
    """The part inventory.

    During a run the cell host manages the inventory of its scene; otherwise it is read from disk.

    Args:
        hub: publishes them.
        directory: the checkpoints of all scenes.
    """

    def __init__(self, hub: EventHub, directory: Path) -> None:
        self._hub = hub
        self.directory = directory
        self._live: PartInventory | None = None
        self._scene_id = ""
        """The scene of the present run; empty if no program runs."""
        self._using_files = asyncio.Lock()
        self.on_change: list[Callable[[PartInventory], None]] = []
        """Called with an inventory that has changed."""

    # -------------------------------------------------------------------------------- runs
    async def require_confirmed(self, package: Path) -> str:
        """Return the scene of a package; empty if it cannot be read, which the cell host reports.

        Raises:
            RequestRefused: a person has to confirm where parts are.
        """
        try:
            content = await asyncio.to_thread((package / "data" / "scene.json").read_bytes)
            scene_id = msgspec.json.decode(content, type=_SceneId).id
        except (OSError, msgspec.MsgspecError):
            return ""
        inventory = await self._stored(scene_id)
        if inventory is not None and inventory.unconfirmed:
            names = ", ".join(f"{part.shown} ({inventory.name_of(part.place)})" for part in inventory.unconfirmed)
            raise RequestRefused(
                "Confirm where these parts are before the program starts: {parts}. "
                "The operator's screen and the panel Run ask for it.",
                parts=names,
            )
        return scene_id

    async def require_continues(self, scene_id: str, package_id: str, at: int | None = None) -> int:
        """Check that the last program of a scene was interrupted and can continue. Return the number of its run.

        Args:
            scene_id: the scene.
            package_id: the package of the program.
            at: position in the cycle of the action at which it continues; None for the interrupted action.

        Raises:
            RequestRefused: it cannot. The message names the missing condition.
        """
        inventory = await self._stored(scene_id)
        run = UNSET if inventory is None else inventory.run
        if isinstance(run, Unset) or run.package_id != package_id:
            raise RequestRefused("This program was not interrupted. Start it from its beginning.")
        if not run.confirmed:
            raise RequestRefused("Confirm first where the parts are, then continue the program.")
        if at is not None and inventory is not None:
            found = next((one for one in _restarts(inventory, run) if one.at == at), None)
            if found is None:
                raise RequestRefused("The interrupted cycle has no action {at} at which it could continue.", at=at)
            if found.text:
                raise RequestRefused(found.as_message(found.text))
            return run.run
        if name := run.why_not():
            raise RequestRefused(
                "The program cannot continue, because the result of {action} is not stored, or it would have to "
                "be repeated. Start it from its beginning.",
                action=name,
            )
        if not run.published().continues:
            raise RequestRefused(
                "The program cannot continue, because its cycle is not stored. Start it from its beginning."
            )
        return run.run

    def begin_run(self, scene_id: str) -> None:
        """Handle the start of a run. From now on, the cell host manages the inventory of its scene."""
        self._scene_id, self._live = scene_id, None

    def changed(self, inventory: PartInventory) -> None:
        """Handle the inventory from the cell host."""
        self._live = inventory
        self._publish(inventory)

    def end_run(self) -> str:
        """Handle the end of the run, and return its scene."""
        scene_id, self._scene_id, self._live = self._scene_id, "", None
        return scene_id

    async def publish(self, scene_id: str) -> None:
        """Publish the stored inventory of a scene."""
        inventory = await self._stored(scene_id) if scene_id else None
        if inventory is not None and (inventory.places or not isinstance(inventory.run, Unset)):
            self._publish(_published(inventory))

    def _publish(self, inventory: PartInventory) -> None:
        self._hub.broadcast(make_event(PARTS, inventory))
        for notify in self.on_change:
            notify(inventory)

    # -------------------------------------------------------------------------------- people
    async def all(self) -> list[PartInventory]:
        """Return the inventories of all scenes; `run` only of a run that was interrupted."""
        scenes = await asyncio.to_thread(stored_scenes, self.directory)
        found = [self._live if scene == self._scene_id else await self._stored(scene) for scene in scenes]
        return [
            _published(inventory)
            for inventory in found
            if inventory is not None and (inventory.places or not isinstance(inventory.run, Unset))
        ]

    async def confirm(self, host: HostGroup | None, args: ConfirmPartsArgs, by: str) -> None:
        """Record the places at which a person has found parts. Nothing moves.

        Args:
            host: runs the program; None if no program runs.
            args: the parts, and whether the interrupted program does not continue.
            by: name of the user.

        Raises:
            RequestRefused: this scene has no inventory, or an action is running.
            NotFound: there is no such part or place.
            Conflict: the parts contradict each other.
        """
        scene_id, parts = args.scene_id, args.parts
        if scene_id == self._scene_id:
            if args.dismiss:
                raise RequestRefused("The program is running. Stop it instead.")
            if host is None:
                raise RequestRefused("The program is starting or ending. Try again.")
            await host.confirm_parts(parts)
        else:
            await self._confirm_stored(args)
        log.info("parts confirmed", scene=scene_id, by=by, parts=[(part.number, part.place) for part in parts])
        if args.dismiss:
            log.info("interrupted program dismissed", scene=scene_id, by=by)

    async def _confirm_stored(self, args: ConfirmPartsArgs) -> None:
        async with self._using_files:
            inventory = await asyncio.to_thread(self._read, args.scene_id)
            if inventory is None:
                raise RequestRefused("No parts are recorded for the scene {scene}.", scene=args.scene_id)
            ledger = Ledger(inventory)
            ledger.confirm(args.parts)
            corrected = ledger.inventory
            if args.dismiss:
                corrected = replace(corrected, run=UNSET)
            elif not isinstance(inventory.run, Unset):  # it can continue once all parts are confirmed
                run = replace(inventory.run, interrupted=True, confirmed=not corrected.unconfirmed)
                corrected = replace(corrected, run=run)
            await asyncio.to_thread(self._write, corrected)
        self._publish(_published(corrected))

    # -------------------------------------------------------------------------------- files
    async def _stored(self, scene_id: str) -> PartInventory | None:
        async with self._using_files:
            return await asyncio.to_thread(self._read, scene_id)

    def _read(self, scene_id: str) -> PartInventory | None:
        """Read the inventory of a scene without a run. After an interrupted run, no place of a part is confirmed."""
        inventory = CheckpointFile(self.directory, scene_id).read()
        if inventory is None or isinstance(inventory.run, Unset):
            return inventory
        if inventory.run.ended:
            return replace(inventory, run=UNSET)
        if inventory.run.interrupted:  # a person has confirmed some of the parts
            return inventory
        ledger = Ledger(inventory)
        ledger.interrupt()
        return replace(ledger.inventory, run=inventory.run)

    def _write(self, inventory: PartInventory) -> None:
        file = CheckpointFile(self.directory, inventory.scene_id)
        try:
            file.write(inventory)
        finally:
            file.close()


def _published(inventory: PartInventory) -> PartInventory:
    """Return an inventory as clients see it."""
    if isinstance(inventory.run, Unset):
        return inventory
    return replace(inventory, run=replace(inventory.run.published(), restarts=_restarts(inventory, inventory.run)))


def _restarts(inventory: PartInventory, run: RunCheckpoint) -> list[Restart]:
    """Return the completed actions of the interrupted cycle, and for each why the program cannot continue there."""
    if not run.complete or not run.confirmed or run.cycle < 1:
        return []
    found = []
    for at, done in enumerate(run.done):
        if done.branch == MAIN_BRANCH:
            why = _why_not(inventory, run, at)
            texts = {} if why is None else {"text": why.text, **why.translation()}
            found.append(Restart(at, done.action_id, done.name, **texts))
    return found


def _why_not(inventory: PartInventory, run: RunCheckpoint, at: int) -> Message | None:
    """Return why an interrupted program cannot continue at an action of its cycle; None if it can."""
    if name := run.until(at).why_not():
        return Message.of("The result of {action} is not stored, or it would have to be repeated.", action=name)
    places = {place.id: place for place in inventory.places}
    move = next((done for done in run.done[at:] if done.moved), None)
    if move is None or not {move.source, move.target} <= places.keys():
        return None
    source, target = places[move.source], places[move.target]
    there = [part for part in inventory.parts if part.place == source.id]
    if not there and source.kind is not PlaceKind.FEEDER:
        return Message.of("{action} needs a part at {place}, and there is none.", action=move.name, place=source.name)
    others = [part.shown for part in inventory.parts if part.place == target.id and part not in there]
    if target.capacity and len(others) >= target.capacity:
        return Message.of("{action} needs room at {place}, where part {part} is.", action=move.name,
                          place=target.name, part=others[0])  # fmt: skip
    return None
