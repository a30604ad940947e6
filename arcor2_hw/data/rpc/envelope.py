"""The envelopes of requests and answers, and how a request is declared."""

from typing import Any

from msgspec import Raw, Struct

from arcor2_hw.data.base import UNSET, Data, Unset
from arcor2_hw.data.role import Role


class Rpc(Struct, frozen=True):
    """Declares one request: types of `args` and of the answer's `data` (None: there is none), and the least role.

    `args_optional`: the arguments may be left out. `dry_run`: the request may ask for its checks alone.
    `additional`: it is not of the ARCOR2 protocol (docs/protocol.md).
    """

    name: str
    args: Any
    data: Any
    role: Role
    args_optional: bool = False
    dry_run: bool = False
    additional: bool = False


class Request(Data, frozen=True):
    """The envelope of a request; `args` is decoded when the request is known.

    `codes`: a refusal is to name its reason (docs/protocol.md).
    """

    id: int
    request: str
    args: Raw | Unset = UNSET
    dry_run: bool = False
    codes: bool = False


class Response(Data, frozen=True):
    """The envelope of an answer. `code`: the reason of a refusal, for those who ask for it."""

    id: int
    response: str
    result: bool
    messages: list[str] | Unset = UNSET
    data: Any = UNSET
    code: str | Unset = UNSET
