"""A bundle for diagnosis: what is open, which types and versions there are, how devices are, the log's last lines.

It is made when somebody asks for it, and goes to him alone. Secrets are left out, and its size is bounded.
"""

import io
import platform
import zipfile
from collections.abc import Iterable, Set
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_hw.data.base import Data, Unset, now
from arcor2_server.log.recent import RECENT
from arcor2_server.log.redaction import clean, hide, secrets_in
from arcor2_server.services import Services

LARGEST_PART: Final = 4 * 1024 * 1024
"""Bytes of one file in it, unpacked; a larger one is left out, and said to be."""
LARGEST_NOTES: Final = 256 * 1024
"""Bytes of what a client brings along."""
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


def parts(services: Services) -> dict[str, Any]:
    """Give the content of the bundle by file; to be called where the services live. Quick: nothing is encoded yet."""
    from arcor2_server.rpc.general import API_VERSION, VERSION  # which needs access, and that the routes

    session, cell, execution = services.session, services.cell, services.execution
    return {
        "about.json": {
            "time": now(),
            "version": VERSION,
            "api_version": API_VERSION,
            "settings": services.settings,
            "people": sorted(client.user for client in services.hub.clients if client.user),
        },
        "types.json": [_type(services, name) for name in services.types.names()],
        "scene.json": session.scene,
        "project.json": session.project,
        "devices.json": {
            "scene": cell.state,
            "package": execution.state,
            "devices": execution.board.statuses() or cell.board.statuses(),
            "objects": execution.board.states() or cell.board.states(),
            "unsaved": session.has_changes,
        },
        "runs.json": services.runs.newest(RUNS, None, None, None),
    }


def _type(services: Services, name: str) -> dict[str, Any]:
    meta = services.types.meta(name)
    own = next((each for each in services.types.sources_for([name]) if each.name == name), None)
    return {
        "type": name,
        "base": meta.base,
        "from": "the server" if own is None else own.distribution or "uploaded",
        "version": "" if own is None else own.version,
        "disabled": meta.disabled,
        "problem": "" if isinstance(meta.problem, Unset) else meta.problem,
    }


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
