"""The envelopes of requests and answers, and the declaration of a request."""

from typing import Annotated, Any

from msgspec import Meta, Raw, Struct

from arcor2_hw.data.base import UNSET, Data, TranslatableData, Unset
from arcor2_hw.data.role import Role


class Rpc(Struct, frozen=True):
    """Declaration of a request: types of `args` and of the answer's `data` (None: no data), and the minimum role.

    `args_optional`: the arguments may be omitted. `dry_run`: the request may be only checked. `additional`: it is not
    part of the ARCOR2 protocol.
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

    `codes`: whether refusals contain their reason, and answers the data for the translation of their messages.
    `step`: edits of a user with the same name of a step are undone together.
    """

    id: int
    request: str
    args: Raw | Unset = UNSET
    dry_run: bool = False
    codes: bool = False
    step: Annotated[str, Meta(max_length=100)] = ""


class Response(TranslatableData, frozen=True):
    """The envelope of an answer. `code`, `key`, `values`: reason and translation of a refusal, if requested."""

    id: int
    response: str
    result: bool
    messages: list[str] | Unset = UNSET
    data: Any = UNSET
    code: str | Unset = UNSET
