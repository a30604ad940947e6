"""Answers of a server about object types, without texts that later versions may word differently."""

import json
from typing import Any

import msgspec

from arcor2_hw.client import Client
from arcor2_hw.data import rpc

TYPES = ("shelf", "old_feeder")
"""Uploaded object types, by the names of their files."""
TEXTS = {"description", "display_name", "problem", "modified"}


def without_texts(value: Any) -> Any:
    """Return an answer without its texts and times."""
    if isinstance(value, dict):
        return {key: without_texts(each) for key, each in value.items() if key not in TEXTS}
    if isinstance(value, list):
        return [without_texts(each) for each in value]
    return value


async def answers(client: Client) -> dict[str, Any]:
    """Return GetObjectTypes, and GetActions of every type, without their texts."""
    types = await client.call("GetObjectTypes")
    actions = {meta.type: await client.call("GetActions", rpc.TypeArgs(meta.type)) for meta in types}
    plain = json.loads(msgspec.json.encode({"types": sorted(types, key=lambda meta: meta.type), "actions": actions}))
    return without_texts(plain)
