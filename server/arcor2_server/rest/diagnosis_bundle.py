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
from arcor2_hw.data.rpc import ListRunsArgs
from arcor2_server.documents import Session
from arcor2_server.events import EventHub
from arcor2_server.execution.runs import Runs
from arcor2_server.execution.service import Execution
from arcor2_server.log.recent import RECENT
from arcor2_server.log.redaction import clean, hide, secrets_in
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.settings import API_VERSION, VERSION, ServerSettings

MAX_PART: Final = 4 * 1024 * 1024
"""Maximum size of an uncompressed file, bytes. A note replaces a larger file."""
MAX_NOTES: Final = 256 * 1024
"""Maximum size of the notes from a client, bytes."""
RUNS: Final = 20
"""Number of the latest runs in the bundle."""

_README: Final = """Diagnosis bundle of ARCOR2-HW

about.json      versions of the server, Python and packages; settings of the server
types.json      object types, their origin and their problems
scene.json      the open scene, with unsaved changes
project.json    the open project, with unsaved changes
devices.json    connection, health and alarms of the devices; state of the scene and the program
runs.json       the latest runs of packages and their results
log.jsonl       the latest lines of the server log
client.json     notes of the client that requested this bundle, such as its last events

Secret settings, tokens and passwords are replaced by ***. The bundle still contains names of users, names of devices
and network addresses. Check it before you share it. The server has not sent it anywhere else.
"""


class ClientNotes(Data, frozen=True):
    """Notes of a client: its version, the browser, its last events and errors."""

    client: dict[str, Any]


def packed(content: dict[str, Any], notes: Any = None, stored: Set[str] = frozenset()) -> bytes:
    """Return the bundle as a zip without secrets. This takes a while, so run it in a thread.

    Args:
        content: the files by name.
        notes: notes of the client.
        stored: the stored secrets of settings.
    """
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
    if len(encoded) > MAX_PART:
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
        """Return the content of the bundle by file name, before encoding. Call this in the event loop."""
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
            "runs.json": self._runs.find(ListRunsArgs(limit=RUNS)),
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
