"""The books of parts of all scenes: their publication, their state after an interruption, and corrections by people."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Final

import msgspec
import structlog
from msgspec import UNSET
from msgspec.structs import replace

from arcor2_hw.data.base import Unset
from arcor2_hw.data.parts import PartBooks, PlaceKind, Restart, RunCheckpoint
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
"""The additional event with the books of a scene."""


class _SceneId(msgspec.Struct):
    id: str


class AllPartBooks:
    """The books of parts. During a run the cell host keeps those of its scene, otherwise they are read from disk.

    Args:
        hub: publishes them.
        directory: the checkpoints of all scenes.
    """

    def __init__(self, hub: EventHub, directory: Path) -> None:
        self._hub = hub
        self.directory = directory
        self._live: PartBooks | None = None
        self._scene_id = ""
        """The scene of the present run; empty if no program runs."""
        self._using_files = asyncio.Lock()
        self.on_change: list[Callable[[PartBooks], None]] = []
        """Called with books that have changed."""

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
        books = await self._stored(scene_id)
        if books is not None and books.unconfirmed:
            names = ", ".join(f"{part.shown} ({books.name_of(part.place)})" for part in books.unconfirmed)
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
            at: position in the cycle of the action at which it continues; None for where it was interrupted.

        Raises:
            RequestRefused: it cannot. The message names the missing condition.
        """
        books = await self._stored(scene_id)
        run = UNSET if books is None else books.run
        if isinstance(run, Unset) or run.package_id != package_id:
            raise RequestRefused("This program was not interrupted. Start it from its beginning.")
        if not run.confirmed:
            raise RequestRefused("Confirm first where the parts are, then continue the program.")
        if at is not None and books is not None:
            found = next((one for one in _restarts(books, run) if one.at == at), None)
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
        """Handle the start of a run. The cell host keeps the books of its scene."""
        self._scene_id, self._live = scene_id, None

    def changed(self, books: PartBooks) -> None:
        """Handle the books from the cell host."""
        self._live = books
        self._publish(books)

    def end_run(self) -> str:
        """Handle the end of the run, and return its scene."""
        scene_id, self._scene_id, self._live = self._scene_id, "", None
        return scene_id

    async def publish(self, scene_id: str) -> None:
        """Publish the stored books of a scene."""
        books = await self._stored(scene_id) if scene_id else None
        if books is not None and (books.places or not isinstance(books.run, Unset)):
            self._publish(_published(books))

    def _publish(self, books: PartBooks) -> None:
        self._hub.broadcast(make_event(PARTS, books))
        for notify in self.on_change:
            notify(books)

    # -------------------------------------------------------------------------------- people
    async def all(self) -> list[PartBooks]:
        """Return the books of all scenes; `run` only of a run that was interrupted."""
        scenes = await asyncio.to_thread(stored_scenes, self.directory)
        found = [self._live if scene == self._scene_id else await self._stored(scene) for scene in scenes]
        return [
            _published(books)
            for books in found
            if books is not None and (books.places or not isinstance(books.run, Unset))
        ]

    async def confirm(self, host: HostGroup | None, args: ConfirmPartsArgs, by: str) -> None:
        """Record where a person has found parts. Nothing moves.

        Args:
            host: runs the program; None if no program runs.
            args: the parts, and whether the interrupted program does not continue.
            by: name of the user.

        Raises:
            RequestRefused: there are no books of this scene, or an action is running.
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
            books = await asyncio.to_thread(self._read, args.scene_id)
            if books is None:
                raise RequestRefused("No parts are recorded for the scene {scene}.", scene=args.scene_id)
            ledger = Ledger(books)
            ledger.confirm(args.parts)
            corrected = ledger.books
            if args.dismiss:
                corrected = replace(corrected, run=UNSET)
            elif not isinstance(books.run, Unset):  # it can continue once all parts are confirmed
                run = replace(books.run, interrupted=True, confirmed=not corrected.unconfirmed)
                corrected = replace(corrected, run=run)
            await asyncio.to_thread(self._write, corrected)
        self._publish(_published(corrected))

    # -------------------------------------------------------------------------------- files
    async def _stored(self, scene_id: str) -> PartBooks | None:
        async with self._using_files:
            return await asyncio.to_thread(self._read, scene_id)

    def _read(self, scene_id: str) -> PartBooks | None:
        """Read the books of a scene without a run. After an interrupted run, no place of a part is confirmed."""
        books = CheckpointFile(self.directory, scene_id).read()
        if books is None or isinstance(books.run, Unset):
            return books
        if books.run.ended:
            return replace(books, run=UNSET)
        if books.run.interrupted:  # a person has confirmed some of the parts
            return books
        ledger = Ledger(books)
        ledger.interrupt()
        return replace(ledger.books, run=books.run)

    def _write(self, books: PartBooks) -> None:
        file = CheckpointFile(self.directory, books.scene_id)
        try:
            file.write(books)
        finally:
            file.close()


def _published(books: PartBooks) -> PartBooks:
    """Return books as clients see them."""
    if isinstance(books.run, Unset):
        return books
    return replace(books, run=replace(books.run.published(), restarts=_restarts(books, books.run)))


def _restarts(books: PartBooks, run: RunCheckpoint) -> list[Restart]:
    """Return the actions of the program that the interrupted cycle has done, and why it cannot continue there."""
    if not run.complete or not run.confirmed or run.cycle < 1:
        return []
    found = []
    for at, done in enumerate(run.done):
        if done.branch == MAIN_BRANCH:
            why = _why_not(books, run, at)
            texts = {} if why is None else {"text": why.text, **why.translation()}
            found.append(Restart(at, done.action_id, done.name, **texts))
    return found


def _why_not(books: PartBooks, run: RunCheckpoint, at: int) -> Message | None:
    """Return why an interrupted program cannot continue at an action of its cycle; None if it can."""
    if name := run.until(at).why_not():
        return Message.of("The result of {action} is not stored, or it would have to be repeated.", action=name)
    places = {place.id: place for place in books.places}
    move = next((done for done in run.done[at:] if done.moved), None)
    if move is None or not {move.source, move.target} <= places.keys():
        return None
    source, target = places[move.source], places[move.target]
    there = [part for part in books.parts if part.place == source.id]
    if not there and source.kind is not PlaceKind.FEEDER:
        return Message.of("{action} needs a part at {place}, and there is none.", action=move.name, place=source.name)
    others = [part.shown for part in books.parts if part.place == target.id and part not in there]
    if target.capacity and len(others) >= target.capacity:
        return Message.of("{action} needs room at {place}, where part {part} is.", action=move.name,
                          place=target.name, part=others[0])  # fmt: skip
    return None
