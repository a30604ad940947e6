"""Declares which method handles which request, and collects the handlers of a server."""

from collections.abc import Callable
from typing import Any, Final, TypeVar

from arcor2_hw.data.rpc import RPCS
from arcor2_server.websocket.request import CachedAnswer, Context, Handler

__all__ = ["DECLARED", "Context", "Handlers", "cached", "rpc"]

F = TypeVar("F", bound=Callable[..., Any])

DECLARED: Final[dict[str, str]] = {}
"""The module that declares the handler of each request."""
_REQUEST: Final = "_handled_request"
"""Attribute of a handler with the name of its request."""
_CACHED: Final = "_cached_request"
"""Attribute of a method that returns a cached answer, with the name of its request."""


def rpc(name: str) -> Callable[[F], F]:
    """Declare a method as the handler of a request. arcor2_hw.data.rpc declares its arguments, answer and role."""
    if name not in RPCS:
        raise KeyError(f"The protocol has no request {name}.")

    def register(handler: F) -> F:
        if name in DECLARED:
            raise KeyError(f"{name} has two handlers.")
        DECLARED[name] = handler.__module__
        setattr(handler, _REQUEST, name)
        return handler

    return register


def cached(name: str) -> Callable[[F], F]:
    """Declare a method that returns the cached answer of a request without arguments (see CachedAnswer)."""
    if RPCS[name].args is not None:
        raise KeyError(f"{name} has arguments.")

    def register(method: F) -> F:
        setattr(method, _CACHED, name)
        return method

    return register


class Handlers:
    """The handlers of one server by request.

    Args:
        groups: objects whose methods are declared by `rpc` and `cached`.
    """

    def __init__(self, *groups: object) -> None:
        self.by_request: dict[str, Handler] = {}
        self.cached: dict[str, CachedAnswer] = {}
        for group in groups:
            for attribute in vars(type(group)):
                declared = getattr(type(group), attribute)
                if (name := getattr(declared, _REQUEST, None)) is not None:
                    self.by_request[name] = getattr(group, attribute)
                if (name := getattr(declared, _CACHED, None)) is not None:
                    self.cached[name] = getattr(group, attribute)
