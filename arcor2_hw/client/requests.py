"""A method for every request, built from the protocol types; requests.pyi declares them for type checkers."""

import inspect
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from inspect import Parameter
from typing import Any

import msgspec

from arcor2_hw.client.signatures import COLLECTIONS, description, method_name, parameters, struct_of
from arcor2_hw.client.stream import LIMIT, EventStream
from arcor2_hw.data.events import EVENTS
from arcor2_hw.data.rpc import RPCS, Rpc


class Requests(ABC):
    """All requests as methods, with typed arguments and answers.

    They raise the errors of `call`. `timeout`: time limit, s, by default that of the client. `dry_run`: whether the
    server only checks the request.
    """

    @abstractmethod
    async def call(self, name: str, args: Any = None, *, dry_run: bool = False, timeout: float | None = None) -> Any:
        """Send a request and return its data."""

    @abstractmethod
    def _follow(self, names: frozenset[str], limit: int) -> EventStream[Any]:
        """Return a new stream."""

    def follow(self, *names: str, limit: int = LIMIT) -> EventStream[Any]:
        """Return a stream of the events with these names, or of all events without names, from now on.

        Additional events are received only after `subscribe_events`. `limit`: maximum number of waiting events. Close
        the stream, or use it in `with`, when you no longer read it.
        """
        if unknown := set(names) - EVENTS.keys():
            raise ValueError(f"unknown event: {', '.join(sorted(unknown))}")
        return self._follow(frozenset(names), limit)


def _method(rpc: Rpc) -> Callable[..., Awaitable[Any]]:
    struct = struct_of(rpc)
    signature = inspect.Signature([Parameter("self", Parameter.POSITIONAL_ONLY), *parameters(rpc)])
    collections = {
        field.name: field.default_factory
        for field in ([] if struct is None else msgspec.structs.fields(struct))
        if field.default_factory in COLLECTIONS
    }

    async def method(*arguments: Any, **keywords: Any) -> Any:
        given = signature.bind(*arguments, **keywords).arguments
        client: Requests = given.pop("self")
        options = {name: given.pop(name) for name in ("dry_run", "timeout") if name in given}
        args: Any = given.get("items")
        if struct is not None:
            given |= {name: collections[name](given[name]) for name in given.keys() & collections}
            args = struct(**given)
        return await client.call(rpc.name, args, **options)

    method.__name__ = method_name(rpc.name)
    method.__qualname__ = f"Requests.{method.__name__}"
    method.__doc__ = description(rpc)
    method.__dict__["__signature__"] = signature
    return method


for _rpc in RPCS.values():
    setattr(Requests, method_name(_rpc.name), _method(_rpc))
