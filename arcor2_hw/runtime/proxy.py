"""Proxies of devices for a script: every call runs on the lane of the device, and actions are reported."""

import inspect
import types
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, cast

from arcor2_hw.actions import deadline_of, metadata_of
from arcor2_hw.actions.decorator import with_present_names
from arcor2_hw.data.held import HoldChoice
from arcor2_hw.exceptions import Arcor2Error, InvalidData, ProgramFinished, ProgramStopped
from arcor2_hw.objects import Generic
from arcor2_hw.runtime.device import STOP_DEADLINE, Device
from arcor2_hw.runtime.lane import on_any_lane
from arcor2_hw.runtime.methods import WITHOUT_IO
from arcor2_hw.runtime.program import Program

_DEVICE = "_arcor2_device"
_PROGRAM = "_arcor2_program"


def _bind(bound: Any, arguments: tuple[Any, ...], keywords: Mapping[str, Any]) -> list[Any]:
    """Return the values of all arguments, positional and named, in the order of the signature."""
    try:
        return list(inspect.signature(bound).bind(*arguments, **keywords).arguments.values())
    except TypeError:  # the call itself raises an error with a better message
        return list(arguments)


def _plain_call(device: Device, program: Program, name: str, bound: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a method that is not an action: it runs on the lane of the device and is not reported."""
    cls = type(device.require())
    if name == "stop" or name in cls.CANCEL_MAPPING.values():
        lane, deadline = device.stop_lane, cast("float | None", STOP_DEADLINE)
    else:
        lane, deadline = device.lane_for(name), deadline_of(bound)

    def call(*arguments: Any, **keywords: Any) -> Any:
        if on_any_lane():
            return lane.call(name, bound, arguments, keywords, deadline)
        program.check()
        if not program.in_main_thread:
            return lane.call(name, bound, arguments, keywords, deadline)
        program.inside = True
        try:
            return lane.call(name, bound, arguments, keywords, deadline)
        except Exception as error:
            program.record_error_source(device, error)
            raise
        finally:
            program.inside = False

    return call


def _action_call(device: Device, program: Program, name: str, bound: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap an action: it is reported before and after it runs and can be paused, unless another action calls it."""
    lane, deadline = device.lane, deadline_of(bound)
    what = f"{device.name}.{name}"

    def run(an: str | None, arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        record, step = program.record, None
        if record is not None:
            done = record.outcome(program.branches.current, program.id_of(an), an or what)
            if done is not None:
                return program.outcome_of(done, device, bound)
        keywords = with_present_names(bound, keywords)
        shown = _bind(bound, arguments, keywords) if keywords else arguments
        action = program.action_begins(device.id, what, an, shown)
        if an is not None:
            keywords["an"] = an
        interruption = None
        if record is not None and record.continuation is not None:
            interruption = record.continuation.interruption(program.branches.current, action, an or what)
        while True:
            try:
                if interruption is not None:
                    error, interruption = interruption, None
                    raise error
                with program.interlocks.guarded(device, name, shown, program.wait_to_start):
                    device.require_confirmed(lane)
                    if program.recovery is not None:
                        program.recovery.take_control(device)
                    if record is not None:
                        branch = program.branches.current
                        step = record.begin(action, an or what, branch, device, bound, arguments, keywords)
                    value = lane.call(name, bound, arguments, keywords, deadline)
                if record is not None and step is not None:
                    record.end(step, value)
            except ProgramFinished:
                if record is not None and step is not None:
                    record.end(step, None)
                program.action_ended(action, None)
                raise
            except BaseException as error:
                if record is not None and step is not None:
                    record.fail(step)
                try:
                    check = partial(record.require_arrived, step) if record is not None else lambda: None
                    decision = program.hold(action, an or what, device, bound, error, check)
                except Arcor2Error as chosen:  # the error of an error exit
                    if record is not None:
                        record.handled(action, an or what, program.branches.current, device, bound, chosen)
                    raise
                if decision is None:
                    if record is not None and not program.stop_requested:
                        record.handled(action, an or what, program.branches.current, device, bound, error)
                    program.action_failed(action, error)
                    if program.stop_requested and isinstance(error, Exception):
                        raise ProgramStopped from error
                    program.record_error_source(device, error)
                    raise
                value = decision.value
                if decision.choice is HoldChoice.RETRY:
                    action = program.action_repeats(action, device.id, what, an, shown)
                    continue
                if record is not None and step is not None:  # the action counts as completed
                    record.end(step, value)
                elif record is not None:
                    record.decided(action, an or what, program.branches.current, device, bound, value)
            program.action_ended(action, value)
            return value

    def call(*arguments: Any, an: str | None = None, **keywords: Any) -> Any:
        if on_any_lane():
            if an is not None:
                raise InvalidData(
                    "{what} is called inside another action and must not have a name (an={an!r})", what=what, an=an
                )
            return lane.call(name, bound, arguments, keywords, deadline)
        if not program.in_main_thread:
            return run(an, arguments, keywords)
        program.inside = True
        try:
            return run(an, arguments, keywords)
        finally:
            program.inside = False

    return call


class Proxy:
    """Forward attributes and methods to a device. `isinstance` returns the same as for the device itself."""

    def __init__(self, device: Device, program: Program) -> None:
        self.__dict__[_DEVICE] = device
        self.__dict__[_PROGRAM] = program

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        return cast("type", self.__dict__[_DEVICE].recipe.cls)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        device: Device = self.__dict__[_DEVICE]
        program: Program = self.__dict__[_PROGRAM]
        instance = device.require()
        if isinstance(inspect.getattr_static(type(instance), name, None), property) and name not in WITHOUT_IO:
            return _plain_call(device, program, name, getattr)(instance, name)
        value = getattr(instance, name)
        if not isinstance(value, types.MethodType) or value.__self__ is not instance:
            return value
        wrap = _plain_call if metadata_of(value) is None else _action_call
        wrapped = wrap(device, program, name, value)
        self.__dict__[name] = wrapped  # the next access does not call __getattr__
        return wrapped

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.__dict__[_DEVICE].require(), name, value)

    def __dir__(self) -> list[str]:
        return dir(self.__dict__[_DEVICE].require())

    def __repr__(self) -> str:
        device: Device = self.__dict__[_DEVICE]
        return f"<{device.recipe.cls.__name__} {device.name}>"


def proxy(device: Device, program: Program) -> Generic:
    """Return the proxy of a device for a script."""
    return cast("Generic", Proxy(device, program))
