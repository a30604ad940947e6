"""Facts of the ARCOR2 protocol that existing clients rely on; texts in them are blanked.

- `protocol.json`: requests, events and types with their fields. A type is noted as `kind` with `name`, `items` or `of`.
- `states.json`: the answer to every request in six server states when its arguments name nothing.
- `openapi/`: requests and answers of the REST services.
- `sessions/`: recorded sessions, one message a line. A acts, B and C observe; `>` is to the server, `<` from it.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parent


def _read(name: str) -> Any:
    return json.loads((_FOLDER / name).read_text())


PROTOCOL: dict[str, Any] = _read("protocol.json")
STATES: dict[str, dict[str, str]] = _read("states.json")


@cache
def openapi(service: str) -> dict[str, Any]:
    """Return the OpenAPI document of a REST service of the protocol, such as storage, scene or build."""
    document: dict[str, Any] = _read(f"openapi/{service}.json")
    return document


def session(name: str) -> list[dict[str, Any]]:
    """Return a recorded session as a list of messages, each with `who` and `msg`."""
    return [json.loads(line) for line in (_FOLDER / "sessions" / f"{name}.jsonl").read_text().splitlines()]
