"""Objects of the scene that another host has. The main host calls them through the server, by stubs of the same type.

The computers exchange the same data as the server and its hosts: arguments and results in JSON by the type hints of
the methods, errors with their codes, and the reports of devices.
"""

import functools
import inspect
import itertools
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from msgspec.structs import replace

from arcor2_hw.actions import deadline_of
from arcor2_hw.actions.json_values import encode
from arcor2_hw.data.device import Connection, Health, Reading
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import (
    Arcor2Error,
    ConnectionLost,
    DeviceTimeout,
    InvalidData,
    NotConnected,
    Refused,
    message_of,
)
from arcor2_hw.messages import Message
from arcor2_hw.objects import CollisionObject, Generic, GenericWithPose, HoldsParts, Robot
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.methods import stop_name
from arcor2_hw.runtime.own_process.stubs import object_stub, stub_class
from arcor2_hw.runtime.values import decode_result

CONNECT_TIMEOUT: Final = 40.0
"""Time limit for another host to load the type of an object and to connect it, s; that host has shorter ones."""
ANSWER_TIMEOUT: Final = 10.0
"""Time after the deadline of a call at which the wait for its answer ends, s. The server answers earlier."""
_CONNECTED: Final = (Connection.ONLINE, Connection.BACK)


class _Waiting:
    """A call without an answer. sent: time of sending, s."""

    def __init__(self) -> None:
        self.sent = time.monotonic()
        self.ended = threading.Event()
        self.answer: m.RemoteDone | Arcor2Error | None = None

    def end(self, answer: m.RemoteDone | Arcor2Error) -> None:
        """Pass the answer to the caller."""
        self.answer = answer
        self.ended.set()


class RemoteObjects:
    """The objects of other hosts, and the calls of them that have no answer.

    Args:
        post: sends a message to the server.
    """

    def __init__(self, post: Callable[[m.ToServer], None]) -> None:
        self._post = post
        self._numbers = itertools.count(1)
        self._calls: dict[int, _Waiting] = {}
        self._objects: dict[str, RemoteObject] = {}
        self._computers: Mapping[str, Message] = {}
        self._stops = 0
        self._over = False

    # -------------------------------------------------------------------------------- the scene
    def expect(self, computers: Mapping[str, Message]) -> None:
        """Set the objects of other hosts: their computers by id of the object."""
        self._computers = {**self._computers, **computers}

    def follow(self, object_id: str, changed: Callable[[], None]) -> None:
        """Call a function when the state of an object has changed, on any thread."""
        self._object(object_id).on_change = changed

    def _object(self, object_id: str) -> "RemoteObject":
        return self._objects.setdefault(object_id, RemoteObject(object_id, self))

    def computer(self, object_id: str) -> Message | None:
        """Return the computer of an object that another host has, None for an object of this host."""
        return self._computers.get(object_id)

    def make(self, of: SceneObject, cls: type[Generic], model: ObjectModel | None) -> Generic:
        """Return a stub of an object.

        Raises:
            Refused: robots and grippers cannot be used from another host.
        """
        if issubclass(cls, Robot | HoldsParts):
            raise Refused(
                "{name} must run on the computer of the other robots and grippers, not on {computer}",
                name=of.name,
                computer=self._computers[of.id],
            )
        return self._object(of.id).stub(of, cls, model)

    # -------------------------------------------------------------------------------- from the server
    def changed(self, message: m.RemoteChanged) -> None:
        """Store a new state of an object, which may arrive before the object is expected."""
        self._object(message.object_id).take(message)

    def answered(self, message: m.RemoteDone | m.RemoteFailed) -> None:
        """Pass an answer to the caller. Late answers are ignored."""
        if (waiting := self._calls.pop(message.id, None)) is not None:
            waiting.end(message if isinstance(message, m.RemoteDone) else error_of(message.error))

    def stopped(self) -> None:
        """Record that a stop of the server was passed to the devices. It does not affect later calls."""
        self._stops += 1

    def end(self) -> None:
        """End all calls, because the server has ended. The other hosts stop their devices then."""
        self._over = True
        for waiting in list(self._calls.values()):
            waiting.end(ConnectionLost("The connection to the server was lost."))
        for each in self._objects.values():
            each.wake()

    @property
    def over(self) -> bool:
        """Whether the connection to the server has ended."""
        return self._over

    # -------------------------------------------------------------------------------- calls
    def call(
        self, object_id: str, method: str, arguments: dict[str, bytes], kind: m.RemoteKind, deadline: float | None
    ) -> tuple[m.RemoteDone, float]:
        """Call a method of an object of another host; return the answer, and when the call was sent, s.

        Raises:
            Arcor2Error: the error of the call, with its code.
            OutcomeUnknown: the connection to the other host was lost before the answer.
            DeviceTimeout: there is no answer.
        """
        number, waiting = next(self._numbers), _Waiting()
        self._calls[number] = waiting
        if self._over:
            raise ConnectionLost("The connection to the server was lost.")
        self._post(m.RemoteCall(number, object_id, method, arguments, kind, deadline, self._stops))
        if not waiting.ended.wait(None if deadline is None else deadline + ANSWER_TIMEOUT):
            self._calls.pop(number, None)
            raise DeviceTimeout("{method} was not answered within {deadline:g} s", method=method, deadline=deadline)
        answer = waiting.answer
        if isinstance(answer, m.RemoteDone):
            return answer, waiting.sent
        assert answer is not None
        raise answer


class RemoteObject:
    """One object of another host: its last state, and the connection of its stub.

    Args:
        object_id: id of the scene object.
        remotes: calls its methods.
    """

    def __init__(self, object_id: str, remotes: RemoteObjects) -> None:
        self._id, self._remotes = object_id, remotes
        self._name = ""
        self._cls: type[Generic] = Generic
        self._state = m.RemoteChanged(object_id, Connection.CONNECTING, Health.NORMAL)
        self._news = threading.Condition()
        self._stub: Any = None
        self.on_change: Callable[[], None] = lambda: None
        """Called when the connection has changed, on any thread."""

    def stub(self, of: SceneObject, cls: type[Generic], model: ObjectModel | None) -> Generic:
        """Return a stub, an instance of a subclass of the type. Pose and collision model are known here."""
        self._name, self._cls = of.name, cls
        stub = object_stub(stub_class(cls, (), self._members(cls)), self, 0, None)
        vars(stub).update({"id": of.id, "name": of.name})
        if issubclass(cls, GenericWithPose):
            vars(stub)["_pose"] = of.pose
        if issubclass(cls, CollisionObject):
            shape = None if model is None or model.type.value == "None" else model.model()
            vars(stub).update({"collision_model": shape, "_enabled": True, "_enabled_listener": lambda: None})
        self._stub = stub
        made: Generic = stub
        return made

    def _members(self, cls: type[Generic]) -> dict[str, Any]:
        """Return the members of a stub that are not forwarded."""
        nothing = lambda *_: None  # noqa: E731 - the other host does it
        found: dict[str, Any] = {
            "settings": property(self._no_settings),
            "conditions": Generic.conditions,
            "connection": property(lambda _: self._state.connection),
            "connection_reason": property(lambda _: self._state.reason or ""),
            "health": property(lambda _: self._state.health),
            "shown_values": property(lambda _: self._state.values),
            "connect": lambda _, timeout=0.0: self._wait_connected(),  # noqa: ARG005
            **dict.fromkeys(("attach", "disconnect", "cleanup"), nothing),
        }
        if issubclass(cls, GenericWithPose):
            found |= {"pose": GenericWithPose.pose, "set_pose": self._set_pose, "update_pose": cls.update_pose}
        if issubclass(cls, CollisionObject):
            found |= {"enabled": CollisionObject.enabled, "on_enabled_changed": CollisionObject.on_enabled_changed}
        return found

    def _no_settings(self, _: Any) -> Any:
        raise Refused("{name}: its settings are known only on its own computer", name=self._name)

    def _set_pose(self, stub: Any, pose: Any) -> None:
        """Set the pose on both computers."""
        self.call(0, "set_pose", (pose,), {})
        vars(stub)["_pose"] = pose

    # -------------------------------------------------------------------------------- state
    def take(self, state: m.RemoteChanged) -> None:
        """Store a new state."""
        with self._news:
            self._state = state
            self._news.notify_all()
        if isinstance(self._stub, CollisionObject):
            vars(self._stub)["_enabled"] = state.in_the_way
        self.on_change()

    def wake(self) -> None:
        """Wake the threads that wait for the connection."""
        with self._news:
            self._news.notify_all()

    def _wait_connected(self) -> None:
        """Wait until the other host has connected the object. Raises NotConnected with the reason if it cannot."""
        ended = (*_CONNECTED, Connection.FAILED)
        with self._news:
            self._news.wait_for(lambda: self._state.connection in ended or self._remotes.over, CONNECT_TIMEOUT)
            state = self._state
        if state.connection not in _CONNECTED:
            if state.reason is not None:
                raise NotConnected(state.reason)
            raise NotConnected("{name} is not connected", name=self._name)

    # -------------------------------------------------------------------------------- calls of the stub
    def call(self, target: int, name: str, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:  # noqa: ARG002
        """Call a method of the object.

        Raises:
            InvalidData: an argument or the result is of a kind that does not pass between computers.
            Arcor2Error: the error of the call.
        """
        function = getattr(self._cls, name)
        if name == stop_name(self._cls):
            self._remotes.call(self._id, name, {}, m.RemoteKind.STOP, None)
            return None
        action = next((key for key, value in self._cls.CANCEL_MAPPING.items() if value == name), None)
        if action is not None:
            kind, method, encoded = m.RemoteKind.CANCEL, action, {}
        else:
            kind, method, encoded = m.RemoteKind.CALL, name, self._encoded(name, function, arguments, keywords)
        return self._result(name, *self._remotes.call(self._id, method, encoded, kind, deadline_of(function)))

    def read(self, target: int, name: str) -> Any:  # noqa: ARG002
        """Return a property of the object."""
        deadline = deadline_of(inspect.getattr_static(self._cls, name))
        return self._result(name, *self._remotes.call(self._id, name, {}, m.RemoteKind.CALL, deadline))

    def write(self, target: int, name: str, value: Any) -> None:  # noqa: ARG002
        """Raise an error, because attributes are set only in the process of the object."""
        raise Refused("{name}: {attribute} cannot be set from another computer", name=self._name, attribute=name)

    def _encoded(
        self, name: str, function: Callable[..., Any], arguments: tuple[Any, ...], keywords: dict[str, Any]
    ) -> dict[str, bytes]:
        signature = _signature(function)
        try:
            bound = signature.bind(None, *arguments, **keywords).arguments
        except TypeError as error:
            raise InvalidData("{name}.{method}: {reason}", name=self._name, method=name, reason=error) from error
        found: dict[str, Any] = {}
        for key, value in list(bound.items())[1:]:
            match signature.parameters[key].kind:
                case inspect.Parameter.VAR_KEYWORD:
                    found |= value
                case inspect.Parameter.VAR_POSITIONAL | inspect.Parameter.POSITIONAL_ONLY:
                    raise self._cannot_pass(name, key, Message.of("its parameter has no name"))
                case _:
                    found[key] = value
        try:
            return {key: encode(value).encode() for key, value in found.items()}
        except InvalidData as error:
            raise self._cannot_pass(name, ", ".join(found), message_of(error)) from error

    def _cannot_pass(self, method: str, what: str, reason: Message) -> InvalidData:
        return InvalidData(
            "{name}.{method}: {what} cannot be passed to another computer: {reason}",
            name=self._name,
            method=method,
            what=what,
            reason=reason,
        )

    def _result(self, name: str, answer: m.RemoteDone, sent: float) -> Any:
        if not answer.value:
            return None
        value = decode_result(self._cls, name, answer.value, self._name)
        if isinstance(
            value, Reading
        ):  # its time is from the other computer's clock; the converted age is never too small
            return replace(value, monotonic=sent - max(0.0, answer.stamp - value.monotonic))
        return value


_signature: Final = functools.cache(inspect.signature)


def error_of(data: m.ErrorData) -> Arcor2Error:
    """Return the error that another host has raised, of the same class if this process knows it."""
    kinds = _kinds(Arcor2Error)
    kind = next((each for each in kinds if each.__name__ == data.type and each.code == data.code), None)
    kind = kind or next((each for each in kinds if each.code == data.code), Arcor2Error)
    error = kind.__new__(kind)  # its constructor may require other arguments
    error.args = (data.message.text,)
    vars(error).update({"message": data.message, "detail": data.detail, "code": data.code})
    if data.fault:
        vars(error).update({"fault_code": data.fault, "kind": data.fault})
    return error


def _kinds(kind: type[Arcor2Error]) -> list[type[Arcor2Error]]:
    return [kind, *(each for below in kind.__subclasses__() for each in _kinds(below))]
