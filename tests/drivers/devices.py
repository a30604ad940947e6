"""Drivers made by a test, which are disconnected at its end."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import ParamSpec, TypeVar

from arcor2_hw.objects import Generic

P = ParamSpec("P")
D = TypeVar("D", bound=Generic)


@contextmanager
def disconnecting(build: Callable[P, D]) -> Iterator[Callable[P, D]]:
    """Return a function that calls `build`; the devices that it returned are disconnected at the end."""
    with ExitStack() as stack:

        def make(*arguments: P.args, **options: P.kwargs) -> D:
            device = build(*arguments, **options)
            stack.callback(device.disconnect)
            return device

        yield make
