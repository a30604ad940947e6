"""The diagnosis bundle: open documents, object types, versions, device states and the latest log lines.

It is created on request and sent only to the caller. Secrets are removed and its size is limited.
"""

import io
import platform
import zipfile
from collections.abc import Iterable, Set
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_hw.data.base import Data, Unset, now
from arcor2_server.documents import Session
from arcor2_server.events import EventHub
from arcor2_server.execution.runs import Runs
from arcor2_server.execution.service import Execution
from arcor2_server.log.recent import RECENT
from arcor2_server.log.redaction import clean, hide, secrets_in
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.settings import API_VERSION, VERSION, ServerSettings

LARGEST_PART: Final = 4 * 1024 * 1024
"""Maximum size of one unpacked file, bytes; a larger one is replaced by a note."""
LARGEST_NOTES: Final = 256 * 1024
"""Maximum size of the notes from a client, bytes."""
RUNS: Final = 20

_README: Final = """A bundle for diagnosis of ARCOR2-HW.

about.json      versions of server, Python and packages, settings of the server
types.json      object types, where they come from, what is wrong with them
scene.json      the scene that is open, with changes that are not saved
project.json    the project that is open, likewise
devices.json    connection, health and alarms of devices, and what is under way
runs.json       the last runs of packages, and how they ended
log.jsonl       the last lines of the server's log
client.json     what the client that asked for this saw last

Settings whose names say that they are secret have ***, and so have tokens and passwords in texts. Look through it all
the same before you give it to somebody: names of people, devices and addresses are in it. Nothing was sent anywhere.
"""


class ClientNotes(Data, frozen=True):
    """What a client adds of itself: its version, the browser, its last events and errors."""

    client: dict[str, Any]


def packed(content: dict[str, Any], notes: Any = None, stored: Set[str] = frozenset()) -> bytes:
    """Return the zip without secrets; `stored` are those of settings. Takes a moment: for another thread."""
    plain = msgspec.to_builtins(content, enc_hook=_plain)
    plain["about.json"] |= {
        "python": platform.python_version(),
        "system": platform.platform(),
        "packages": dict(sorted((each.name, each.version) for each in distributions())),
    }
    secrets = set(secrets_in(plain)) | stored
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("README.txt", _README)
        for name, part in (plain | {"client.json": notes}).items():
            if part is not None:
                archive.writestr(name, _text(part, secrets))
        archive.writestr("log.jsonl", _lines(RECENT.lines(), secrets))
    return target.getvalue()


def _text(part: Any, secrets: set[str]) -> str:
    encoded = msgspec.json.format(msgspec.json.encode(hide(part)), indent=2)
    if len(encoded) > LARGEST_PART:
        return f'{{"left_out": "it has {len(encoded)} bytes"}}\n'
    return clean(encoded.decode(), secrets) + "\n"


def _lines(lines: Iterable[str], secrets: set[str]) -> str:
    return "".join(clean(line, secrets) + "\n" for line in lines)


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, Path) else repr(value)


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Collects the content of the diagnosis bundle."""

    _settings: ServerSettings
    _hub: EventHub
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _execution: Execution
    _runs: Runs

    def parts(self) -> dict[str, Any]:
        """Return the content of the bundle by file name, not yet encoded. Call this on the event loop."""

        session, cell, execution = self._session, self._online, self._execution
        return {
            "about.json": {
                "time": now(),
                "version": VERSION,
                "api_version": API_VERSION,
                "settings": self._settings,
                "people": sorted(client.user for client in self._hub.clients if client.user),
            },
            "types.json": [self._type(name) for name in self._types.names()],
            "scene.json": session.scene,
            "project.json": session.project,
            "devices.json": {
                "scene": cell.state,
                "package": execution.state,
                "devices": execution.board.statuses() or cell.board.statuses(),
                "objects": execution.board.states() or cell.board.states(),
                "unsaved": session.has_changes,
            },
            "runs.json": self._runs.newest(RUNS, None, None, None),
        }

    def _type(self, name: str) -> dict[str, Any]:
        meta = self._types.meta(name)
        own = next((each for each in self._types.sources_for([name]) if each.name == name), None)
        return {
            "type": name,
            "base": meta.base,
            "from": "the server" if own is None else own.distribution or "uploaded",
            "version": "" if own is None else own.version,
            "disabled": meta.disabled,
            "problem": "" if isinstance(meta.problem, Unset) else meta.problem,
        }
