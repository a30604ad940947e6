"""Stubs of objects of another process, which forward calls and accesses to attributes."""

import functools
import inspect
import types
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from arcor2_hw.objects import Generic, Settings
from arcor2_hw.runtime.methods import NO_STOP
from arcor2_hw.runtime.own_process.pickling import Description, Stub


class Connection(Protocol):
    """The connection to the process that has the object."""

    def call(self, target: int, name: str, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        """Call a method of an object, or the object itself when the name is empty."""

    def read(self, target: int, name: str) -> Any:
        """Return an attribute of an object."""

    def write(self, target: int, name: str, value: Any) -> None:
        """Set an attribute of an object."""


class _ObjectStub(Stub):
    """Mixin for stubs of scene objects. The other base class is the type of the object, for `isinstance`."""

    _stub_of: type[Generic]

    def __setattr__(self, name: str, value: Any) -> None:
        if name.startswith("_"):
            object.__setattr__(self, name, value)
        else:
            self._peer.write(self._ref, name, value)


class _MethodsStub(Stub):
    """Stub of a function or of an object of which only methods are called."""

    def __init__(self, peer: Connection, ref: int) -> None:
        self._peer, self._ref = peer, ref

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        return lambda *arguments, **keywords: self._peer.call(self._ref, name, arguments, keywords)

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        return self._peer.call(self._ref, "", arguments, keywords)


def stub_of(peer: Connection, description: Description) -> Any:
    """Return a stub of the object of a reference."""
    number, cls, attributes, settings = description
    if cls is None:
        return _MethodsStub(peer, number)
    return object_stub(stub_class(cls, attributes), peer, number, settings)


def object_stub(cls: type[Generic], peer: Connection, number: int, settings: Settings | None) -> Any:
    """Return an instance of a class made by `stub_class`, without calling a constructor."""
    stub = object.__new__(cls)
    vars(stub).update({"_peer": peer, "_ref": number, "_settings": settings})
    return stub


def stub_class(
    cls: type[Generic], attributes: Iterable[str] = (), members: Mapping[str, Any] = types.MappingProxyType({})
) -> type[Generic]:
    """Return a subclass of an object type that forwards public methods and properties.

    Hooks that the type does not override are not forwarded.

    Args:
        cls: The object type.
        attributes: Names of instance attributes to forward.
        members: Members that replace the forwarding ones.
    """
    found: dict[str, Any] = {"_stub_of": cls, "__module__": cls.__module__, "__qualname__": cls.__qualname__}
    for name in dir(cls):
        if not name.startswith("_"):
            member = inspect.getattr_static(cls, name)
            if (forwarded := _forwarded(name, member)) is not None:
                found[name] = forwarded
    found |= {name: _attribute(name) for name in attributes if not name.startswith("_")}
    found |= members
    made: type[Generic] = types.new_class(
        cls.__name__, (_ObjectStub, cls), {"metaclass": type(cls)}, lambda namespace: namespace.update(found)
    )
    return made


def _forwarded(name: str, member: Any) -> Any:
    """Return a forwarding member for a member of a class, or None if it is the same in both processes."""
    if isinstance(member, types.FunctionType):
        # A hook that is not overridden does the same here, and must still be recognized as not overridden.
        same = member in NO_STOP or member is vars(Generic).get(name)
        return None if same else _method(name, member)
    if isinstance(member, staticmethod | classmethod | type) or not hasattr(type(member), "__get__"):
        return None
    return _method(name, member) if callable(member) else _attribute(name, member.__doc__)


def _method(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def forward(self: Any, *arguments: Any, **keywords: Any) -> Any:
        return self._peer.call(self._ref, name, arguments, keywords)

    return forward


def _attribute(name: str, doc: str | None = None) -> property:
    return property(
        lambda self: self._peer.read(self._ref, name),
        lambda self, value: self._peer.write(self._ref, name, value),
        doc=doc,
    )
