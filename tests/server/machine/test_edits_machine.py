"""Clients edit at random, lock, undo, leave and return; the state that each derives from events must be correct.

MACHINE_EXAMPLES=500 makes it a long run (with `--timeout 0`), which also minimizes a failing sequence.
"""

import asyncio
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, settings, strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from arcor2_hw.data.project import Action
from arcor2_hw.data.rpc import RPCS
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks.actions import action_meta
from arcor2_server.documents.checks.project import project_problems
from arcor2_server.documents.logic import check_logic_item
from tests.server.crash_copy import copy_at_one_moment
from tests.server.document_copy import DocumentCopy
from tests.server.machine.client import Client, Flat, flat
from tests.server.machine.requests import EDITS, SCENE_EDITS, Draw, Request
from tests.server.session.session_server import Refused, open_server
from tests.server.session.work import Work

NAMES = ("alice", "bob", "carol")
LIMIT = 60
"""Edits that the journal stores: few enough that a long run exceeds them."""

users = st.integers(0, len(NAMES) - 1)
numbers = st.tuples(st.integers(0, 11), st.integers(0, 11), st.integers(0, 11))
edits = st.sampled_from(sorted(EDITS))
parts = st.tuples(edits, numbers, st.sampled_from(["", "", "", "Undo", "Redo"]))


class Edits(RuleBasedStateMachine):
    """The server's parts run in this process on their own event loop; each rule runs the loop."""

    template: Path

    def __init__(self) -> None:
        super().__init__()
        self.runner = asyncio.Runner()
        self.directory = Path(tempfile.mkdtemp(prefix="machine-"))
        self.clients: dict[str, Client] = {}
        self.states: dict[int, Flat] = {}
        self.saved: Flat = {}

    # ------------------------------------------------------------------------------------------ the server
    @initialize(count=st.integers(2, 3))
    def begin(self, count: int) -> None:
        self.directory.rmdir()
        shutil.copytree(self.template, self.directory)
        self.runner.run(self._open())
        for name in NAMES[:count]:
            self.join(NAMES.index(name))
        self.ask("alice", "OpenProject", id=self.project_id)
        self._opened()

    async def _open(self) -> None:
        self.context = open_server(self.directory, history_limit=LIMIT)
        self.server = await self.context.__aenter__()
        projects = await self.server.services.storage.projects()
        self.project_id, self.scene_id = projects[0].id, projects[0].scene_id

    async def _close(self) -> None:
        for client in self.clients.values():
            await client.person.leave()
        self.clients.clear()
        await self.context.__aexit__(None, None, None)

    def teardown(self) -> None:
        if hasattr(self, "server"):
            self.runner.run(self._close())
        self.runner.close()
        shutil.rmtree(self.directory, ignore_errors=True)

    @property
    def session(self) -> Any:
        return self.server.session

    def current_items(self) -> Flat:
        return flat(DocumentCopy.of(self.session.scene, self.session.project))

    def _opened(self) -> None:
        """Take the saved document as the reference. The test does not know its history."""
        self.saved = self.current_items()
        self.states = {self.session.revision: self.saved}

    # ------------------------------------------------------------------------------------------ requests
    def ask(self, user: str, request: str, **args: Any) -> Any:
        return self.runner.run(self._ask(user, request, **args))

    async def _ask(self, user: str, request: str, /, *, dry_run: bool = False, **args: Any) -> Any:
        try:
            return await self.clients[user].person.ask(request, dry_run=dry_run, **args)
        except Refused as error:
            refusal = error
        assert "inside the server" not in str(refusal), f"{request} {args}: {refusal}"
        return refusal

    def user_of(self, number: int) -> str:
        present = sorted(self.clients)
        return present[number % len(present)]

    def record_state(self) -> None:
        self.states[self.session.revision] = self.current_items()

    def ask_checked(self, user: str, request: str, **args: Any) -> Any:
        """Send a request. If it is refused or a dry run, assert that it changes nothing and causes no event."""
        revision, before = self.session.revision, self.current_items()
        self.apply_events()
        events_before = {client.name: client.events for client in self.clients.values()}
        answer = self.ask(user, request, **args)
        if isinstance(answer, Refused) or (args.get("dry_run") and RPCS[request].dry_run):
            self.apply_events()
            assert (self.session.revision, self.current_items()) == (revision, before), (request, answer)
            assert events_before == {client.name: client.events for client in self.clients.values()}, (request, answer)
        if self.session.revision != revision:
            assert self.session.revision == revision + 1, request
            self.record_state()
        return answer

    def apply_events(self) -> None:
        for client in self.clients.values():
            client.apply_events()

    # ------------------------------------------------------------------------------------------ edits
    def edit(self, user: str, wanted: Request, *, keep: bool, dry_run: bool) -> None:
        request, args, lock, tree = wanted
        if lock:
            self.ask(user, "WriteLock", object_id=lock, lock_tree=tree)
        self.ask_checked(user, request, dry_run=dry_run, **args)
        if lock and not keep:
            self.ask(user, "WriteUnlock", object_id=lock)

    @precondition(lambda self: self.session.project is not None)
    @rule(number=users, kind=edits, chosen=numbers, keep=st.booleans(), dry_run=st.integers(0, 9))
    def edit_project(self, number: int, kind: str, chosen: Any, keep: bool, dry_run: int) -> None:
        wanted = EDITS[kind](Draw(self.session, chosen))
        self.edit(self.user_of(number), wanted, keep=keep and dry_run > 5, dry_run=dry_run == 0)

    @precondition(lambda self: self.session.project is not None)
    @rule(number=users, kinds=st.lists(edits, min_size=2, max_size=3), chosen=numbers)
    def build(self, number: int, kinds: list[str], chosen: Any) -> None:
        for kind in ["add point", "add action", *kinds]:
            self.edit(self.user_of(number), EDITS[kind](Draw(self.session, chosen)), keep=False, dry_run=False)
            chosen = (chosen[0] + 1, chosen[1] + 1, chosen[2] + 1)

    @precondition(lambda self: self.session.scene is not None and self.session.project is None)
    @rule(number=users, kind=st.sampled_from(sorted(SCENE_EDITS)), chosen=numbers)
    def edit_scene(self, number: int, kind: str, chosen: Any) -> None:
        self.edit(self.user_of(number), SCENE_EDITS[kind](Draw(self.session, chosen)), keep=False, dry_run=False)

    @precondition(lambda self: self.session.project is not None)
    @rule(parts=st.lists(parts, min_size=2, max_size=5))
    def edit_together(self, parts: list[Any]) -> None:
        async def together() -> None:
            wanted = [(EDITS[kind](Draw(self.session, chosen)), undo) for kind, chosen, undo in parts]
            requests = []
            for number, ((request, args, _, _), undo) in enumerate(wanted):
                if undo:
                    request, args = undo, {}
                requests.append(self._ask(self.user_of(number), request, **args))
            await asyncio.gather(*requests)

        before = self.session.revision
        self.runner.run(together())
        for revision in range(before + 1, self.session.revision):
            self.states.pop(revision, None)
        self.record_state()

    # ------------------------------------------------------------------------------------------ undo and redo
    @precondition(lambda self: self.session.scene is not None)
    @rule(number=users, times=st.integers(1, 3), redo=st.booleans(), dry_run=st.integers(0, 9))
    def undo(self, number: int, times: int, redo: bool, dry_run: int) -> None:
        user = self.user_of(number)
        for request in ["Undo"] * times + ["Redo"] * (times if redo else 0):
            before = self.session.revision
            answer = self.ask_checked(user, request, dry_run=dry_run == 0)
            if not isinstance(answer, Refused) and dry_run:
                self.assert_undone(before, answer["number"])

    @precondition(lambda self: self.session.scene is not None)
    @rule(number=users, back=st.integers(1, 8))
    def undo_an_earlier_edit(self, number: int, back: int) -> None:
        before = self.session.revision
        answer = self.ask_checked(self.user_of(number), "Undo", number=before - back)
        if not isinstance(answer, Refused):
            self.assert_undone(before, before - back)

    def assert_undone(self, before: int, number: int) -> None:
        """Assert that the undone edit's items are as before it, and all others unchanged."""
        edit = self.session.history.find(number)
        if edit is None or number not in self.states or number - 1 not in self.states:
            return
        old, made = self.states[number - 1], self.states[number]
        touched = {key for key in old.keys() | made.keys() if old.get(key) != made.get(key)}
        expected = {key: value for key, value in self.states[before].items() if key not in touched}
        assert self.current_items() == expected | {key: old[key] for key in touched if key in old}

    @precondition(lambda self: self.session.scene is not None)
    @rule(number=users, back=st.integers(0, 12))
    def restore_revision(self, number: int, back: int) -> None:
        revision = self.session.revision - back
        answer = self.ask_checked(self.user_of(number), "RestoreRevision", revision=revision)
        if not isinstance(answer, Refused) and revision in self.states:
            assert self.current_items() == self.states[revision]

    # ------------------------------------------------------------------------------------------ locks and connections
    @precondition(lambda self: self.session.project is not None)
    @rule(number=users, chosen=numbers, tree=st.booleans(), read=st.booleans(), give_back=st.booleans())
    def lock(self, number: int, chosen: Any, tree: bool, read: bool, give_back: bool) -> None:
        draw = Draw(self.session, chosen)
        item = [draw.point(draw.x), draw.action(draw.x), draw.project.id][draw.y % 3]
        if read:
            self.ask(self.user_of(number), "ReadUnlock" if give_back else "ReadLock", object_id=item)
        elif give_back:
            for held in self.server.services.locks.write_locked_by(self.user_of(number)):
                self.ask(self.user_of(number), "WriteUnlock", object_id=held)
        else:
            self.ask(self.user_of(number), "WriteLock", object_id=item, lock_tree=tree)

    @precondition(lambda self: len(self.clients) > 1)
    @rule(number=users)
    def leave(self, number: int) -> None:
        client = self.clients.pop(self.user_of(number))
        self.runner.run(client.person.leave())

    @precondition(lambda self: hasattr(self, "server"))
    @rule(number=users)
    def join(self, number: int) -> None:
        name = NAMES[number]
        if name in self.clients:
            return

        async def register() -> None:
            self.clients[name] = Client(self.server, name)
            await self._ask(name, "RegisterUser", user_name=name)

        self.runner.run(register())
        self.apply_events()

    @rule(number=users)
    def lock_time_out(self, number: int) -> None:
        """The locks of a disconnected user are released after a delay."""
        if NAMES[number] not in self.clients and NAMES[number] in self.server.services.users._releases:
            self.server.services.users._releases[NAMES[number]].cancel()
            self.server.services.users._release(NAMES[number])

    # ------------------------------------------------------------------------------------------ whole documents
    def release_locks(self) -> None:
        for number in range(len(NAMES)):
            self.lock_time_out(number)
        for user in sorted(self.clients):
            for held in self.server.services.locks.write_locked_by(user):
                assert not isinstance(self.ask(user, "WriteUnlock", object_id=held), Refused)
            for held in list(self.server.services.locks._reads.get(user, ())):
                self.ask(user, "ReadUnlock", object_id=held)
        assert self.server.services.locks.locked_roots() == []

    def stored(self) -> Flat:
        async def read() -> DocumentCopy:
            storage = self.server.services.storage
            project = None if self.session.project is None else await storage.project(self.session.project.id)
            return DocumentCopy.of(await storage.scene(self.session.scene.id), project)

        return flat(self.runner.run(read()))

    @precondition(lambda self: self.session.scene is not None)
    @rule(number=users)
    def save(self, number: int) -> None:
        self.release_locks()
        request = "SaveScene" if self.session.project is None else "SaveProject"
        answer = self.ask_checked(self.user_of(number), request)
        assert isinstance(answer, Refused) is (request == "SaveProject" and self.current_items() == self.saved)
        self.saved = self.current_items()
        assert self.stored() == self.saved

    @rule(number=users, scene=st.booleans())
    def close_and_open(self, number: int, scene: bool) -> None:
        self.release_locks()
        user = self.user_of(number)
        if self.session.scene is not None:
            answer = self.ask(user, "CloseScene" if self.session.project is None else "CloseProject", force=True)
            assert not isinstance(answer, Refused), answer
            self.apply_events()
        request, document = ("OpenScene", self.scene_id) if scene else ("OpenProject", self.project_id)
        answer = self.ask(user, request, id=document)
        # A project cannot be opened after an object that it needs was removed from the scene by force.
        if isinstance(answer, Refused):
            answer = self.ask(user, "OpenScene", id=self.scene_id)
            assert not isinstance(answer, Refused), answer
        self._opened()

    @rule()
    def crash(self) -> None:
        """A killed server leaves only the files that are on the disk now."""
        items_before, changed = self.current_items(), self.session.has_changes
        history = list(self.session.history)
        copied = Path(tempfile.mkdtemp(prefix="machine-")) / "data"
        copy_at_one_moment(self.directory, copied)
        present = sorted(self.clients)
        self.runner.run(self._close())
        shutil.rmtree(self.directory)
        shutil.move(copied, self.directory)
        copied.parent.rmdir()
        self.runner.run(self._open())
        assert (self.current_items(), self.session.has_changes) == (items_before, changed)
        assert list(self.session.history) == history
        assert self.server.services.locks.locked_roots() == []
        for name in present:
            self.join(NAMES.index(name))

    # ------------------------------------------------------------------------------------------ invariants
    @invariant()
    def every_client_has_the_state(self) -> None:
        if not hasattr(self, "server"):
            return
        current_items = self.current_items()
        self.apply_events()
        for client in self.clients.values():
            assert flat(client.copy) == current_items, client.name
        assert self.session.has_changes is (current_items != self.saved)

    @invariant()
    def every_client_knows_the_locks(self) -> None:
        if not hasattr(self, "server") or self.session.project is None:
            return
        locks = self.server.services.locks
        for client in self.clients.values():
            for key, owner in client.copy.locks.items():
                if owner != client.name and key != self.session.project.id and self._exists(key):
                    assert locks.writer_of(key) == owner, (client.name, key, owner)
            for owner, ids in locks.announced().items():
                if owner != client.name:
                    assert not [key for key in ids if client.copy.locks.get(key) != owner], (client.name, owner)

    def _exists(self, key: str) -> bool:
        return any(self.session.document.find(kind, key) is not None for kind in Kind)

    @invariant()
    def documents_are_consistent(self) -> None:
        if not hasattr(self, "server") or (project := self.session.project) is None:
            return
        document, types = self.session.document, self.server.types

        def meta_of(action: Action) -> Any:
            return action_meta(action, document, types)

        assert project_problems(self.session.scene, project, types) == []
        for item in project.logic:
            check_logic_item(document, meta_of, item)
        assert project.has_logic or not project.logic


async def _template(directory: Path) -> None:
    async with open_server(directory) as server:
        alice = await server.person("alice")
        await Work(alice).project("base")
        await alice.ask("SaveProject")
        await alice.ask("CloseProject")


def test_random_edits_keep_clients_locks_and_journal_consistent(tmp_path: Path) -> None:
    Edits.template = tmp_path / "template"
    Edits.template.mkdir()
    asyncio.run(_template(Edits.template))
    case = Edits.TestCase()
    long_run = "MACHINE_EXAMPLES" in os.environ
    case.settings = settings(
        max_examples=int(os.environ.get("MACHINE_EXAMPLES", "16")),
        stateful_step_count=60 if long_run else 40,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        # Minimizing a failing sequence may take minutes.
        phases=list(Phase) if long_run else [Phase.generate],
        print_blob=True,
    )
    case.runTest()
