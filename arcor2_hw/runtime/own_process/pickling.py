"""Pickling of values, errors and object references between the cell host and the process of a device.

Pickle is used because drivers return values of any type: structs, dataclasses, enumerations, images, NumPy arrays. It
is safe here: both ends are processes of this program with the same rights, connected by an unnamed socket pair that no
other process can open, and they load the same object type anyway.
"""

import io
import pickle
import traceback
import types
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from arcor2_hw.exceptions import Arcor2Error, DeviceError, InvalidData
from arcor2_hw.objects import Generic

_VALUES: Final = frozenset({bool, bytes, dict, float, int, list, set, str, tuple, type(None)})
"""Types that are never sent as references. Checked first, because they are the most frequent."""


class ByReference:
    """Base of classes whose instances stay in their process. The other process gets a stub that forwards calls."""


class Stub(ByReference):
    """Base of stubs. `_peer` is the connection to the process of the object, `_ref` the number of the object."""

    _peer: Any
    _ref: int


class Description(NamedTuple):
    """Reference to an object.

    Attributes:
        number: Of the object, assigned by its process.
        cls: Type of an object of the scene; None for other objects, of which only methods are called.
        attributes: Public attributes of the object that its type does not have.
        settings: A copy of the settings of an object of the scene.
    """

    number: int
    cls: type[Generic] | None = None
    attributes: frozenset[str] = frozenset()
    settings: Any = None


class Codec:
    """Pickle values. Objects of the scene, functions and surroundings are sent as references.

    Args:
        stub: Returns the stub of an object of the other process.
    """

    def __init__(self, stub: Callable[[Description], Any]) -> None:
        self.stub = stub
        self._exported: dict[int, Any] = {}
        self._numbers: dict[int, int] = {}

    def export(self, value: Any) -> int:
        """Return the number by which the other process refers to an object of this process."""
        number = self._numbers.get(id(value))
        if number is None:
            number = len(self._exported)
            self._exported[number] = value  # a reference keeps the object alive, so that id() remains unique
            self._numbers[id(value)] = number
        return number

    def exported(self, number: int) -> Any:
        """Return an object of this process by its number."""
        return self._exported[number]

    def encode(self, value: Any) -> bytes:
        """Pickle a value.

        Raises:
            InvalidData: The value contains something that cannot be pickled, such as a lock or a generator.
        """
        buffer = io.BytesIO()
        try:
            _Pickler(buffer, self).dump(value)
        except Exception as error:
            raise InvalidData(
                "a value of type {type} cannot be sent to another process: {reason}",
                type=type(value).__name__,
                reason=error,
            ) from error
        return buffer.getvalue()

    def decode(self, data: bytes) -> Any:
        """Return a value that the other process has pickled.

        Raises:
            InvalidData: A class of the value cannot be imported here.
        """
        try:
            return _Unpickler(io.BytesIO(data), self).load()
        except Exception as error:
            raise InvalidData("a value from another process cannot be decoded: {reason}", reason=error) from error

    def encode_error(self, error: BaseException) -> bytes:
        """Pickle an error with its traceback as a note, or its nearest base class if it cannot be pickled."""
        note = "".join(traceback.format_exception(error)).rstrip()
        if isinstance(error, Arcor2Error):
            for cls in type(error).__mro__:
                if not issubclass(cls, Arcor2Error):
                    break
                try:
                    return self.encode((_restore, (cls, error.args, self._sendable(error), note)))
                except InvalidData:
                    continue
        try:
            data = self.encode((_with_note, (error, note)))
            self.decode(data)
        except InvalidData:
            named = DeviceError("{type}: {reason}", note, type=type(error).__name__, reason=error)
            return self.encode((_with_note, (named, note)))
        return data

    def decode_error(self, data: bytes) -> BaseException:
        """Return an error that the other process has pickled."""
        make, arguments = self.decode(data)
        error: BaseException = make(*arguments)
        return error

    def _sendable(self, error: BaseException) -> dict[str, Any]:
        """Return the attributes of an error that can be pickled."""
        found = {}
        for name, value in vars(error).items():
            try:
                self.encode(value)
            except InvalidData:
                continue
            found[name] = value
        return found


def _restore(cls: type[BaseException], args: tuple[Any, ...], state: dict[str, Any], note: str) -> BaseException:
    """Create an error without calling its constructor, which may have other parameters."""
    error = cls.__new__(cls, *args)
    error.args = args
    vars(error).update(state)
    return _with_note(error, note)


def _with_note(error: BaseException, note: str) -> BaseException:
    error.add_note(f"In the process of the device:\n{note}")
    return error


class _Pickler(pickle.Pickler):
    def __init__(self, file: io.BytesIO, codec: Codec) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._codec = codec

    def persistent_id(self, obj: Any) -> tuple[int | None, Description] | None:
        """Return the reference to an object: its number if the other process has it, and its description."""
        if type(obj) in _VALUES:
            return None
        if isinstance(obj, Stub) and obj._peer.codec is self._codec:
            return obj._ref, Description(0)
        if isinstance(obj, Generic):
            cls: type[Generic] = getattr(obj, "_stub_of", obj.__class__)
            further = frozenset(name for name in dir(obj) if not name.startswith("_") and not hasattr(cls, name))
            return None, Description(self._codec.export(obj), cls, further, getattr(obj, "_settings", None))
        if _by_reference(obj):
            return None, Description(self._codec.export(obj))
        return None

    def reducer_override(self, obj: Any) -> Any:
        """Reduce types that pickle does not support."""
        if isinstance(obj, types.MappingProxyType):
            return types.MappingProxyType, (dict(obj),)
        return NotImplemented


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: io.BytesIO, codec: Codec) -> None:
        super().__init__(file)
        self._codec = codec

    def persistent_load(self, pid: tuple[int | None, Description]) -> Any:
        """Return the object of a reference: an object of this process, or the stub of one of the other process."""
        number, description = pid
        return self._codec.stub(description) if number is None else self._codec.exported(number)


def _by_reference(value: Any) -> bool:
    """Return whether a value is sent as a reference, like a function that cannot be imported by name."""
    if isinstance(value, types.MethodType):
        return not isinstance(value.__self__, Generic | type | types.ModuleType)
    if isinstance(value, types.FunctionType):
        return "<" in value.__qualname__
    return isinstance(value, ByReference)
