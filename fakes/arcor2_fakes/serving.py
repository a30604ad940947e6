"""Serve a fake: its wires, control channel, simulation, ready line and end."""

import asyncio
import contextlib
import inspect
import sys
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from arcor2_fakes.control import ControlServer, Handler, parse_address
from arcor2_fakes.process import OwnTime, announce, run, wait_for_end
from arcor2_fakes.serial_line import Line
from arcor2_fakes.wire import TcpWire, register_faults

Wire = TcpWire | Line


class Fake:
    """A running fake. `serve` creates it and passes it to the function that builds the device."""

    def __init__(self, name: str, channel: ControlServer) -> None:
        self.name, self.channel = name, channel
        self.ready = False
        """Whether the ready line was printed."""
        self._wires: dict[str, Wire] = {}
        self._ends: list[Callable[[], object]] = []
        self._line_state: Callable[[], dict[str, Any]] = dict

    def commands(self, **handlers: Handler) -> None:
        """Register commands of the control channel by name."""
        for name, handler in handlers.items():
            self.channel.command(name, handler)

    def switches(self, device: object, changed: Callable[[], object] = lambda: None, /, **attributes: str) -> None:
        """Register commands that switch an attribute of the device, and then call `changed`.

        Args:
            device: The device.
            changed: Called after each switching.
            attributes: Attributes by the name of the command.
        """

        def switch(attribute: str) -> Handler:
            def apply(on: bool = True) -> None:
                setattr(device, attribute, bool(on))
                changed()

            return apply

        self.commands(**{command: switch(attribute) for command, attribute in attributes.items()})

    def truth(self, read: Callable[[], dict[str, Any]]) -> None:
        """Register the true state, with that of the line, as source `truth` of the control channel."""
        self.channel.source("truth", lambda: read() | self._line_state())

    def at_end(self, call: Callable[[], object]) -> None:
        """Call a function or coroutine function when the fake ends."""
        self._ends.append(call)

    def simulate(self, advance: Callable[[float], object], period: float) -> None:
        """Call `advance` every `period` s with the fake's own time since its last call, s, until the fake ends."""

        async def repeat() -> None:
            own_time = OwnTime()
            own_time.run()
            last = own_time()
            while True:
                await asyncio.sleep(period)
                now = own_time()
                advance(now - last)
                last = now

        self.background(repeat())

    def background(self, work: Coroutine[Any, Any, None]) -> None:
        """Run a coroutine until the fake ends."""
        task = asyncio.create_task(work)

        async def end() -> None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

        self.at_end(end)

    def wires(self, checked: tuple[str, ...] = (), /, **wires: Wire) -> None:
        """Serve on wires and register their faults; `checked` names the wires whose frames end in a checksum."""
        self._wires |= wires
        register_faults(self.channel, dict(wires), checked)

    def line(
        self, line: Line, unplugged: Callable[[], object] = lambda: None, name: str = "serial", checked: bool = False
    ) -> None:
        """Serve on a serial line, and register commands to plug and unplug it.

        Args:
            line: The line.
            unplugged: Called when the line was unplugged.
            name: Name of the line in the commands for faults.
            checked: Whether its frames end in a checksum.
        """

        async def plug() -> str:
            await line.plug()
            return line.port

        async def unplug() -> None:
            await line.unplug()
            unplugged()

        self.wires((name,) if checked else (), **{name: line})
        self.commands(plug=plug, unplug=unplug)
        self._line_state = lambda: {"plugged": line.plugged, "port": line.port}

    def renewable(self, reset: Callable[[], object]) -> None:
        """Register the command `renew`, which calls `reset` and repairs the wires, for tests that share a process."""

        async def renew() -> None:
            reset()
            for wire in self._wires.values():
                await wire.fault("heal")
            self.reset_wires()

        self.commands(renew=renew)

    def reset_wires(self) -> None:
        """Break every TCP connection."""
        for wire in self._wires.values():
            if isinstance(wire, TcpWire):
                wire.reset()

    async def run(self, **addresses: Wire | Callable[[], object]) -> None:
        """Open the wires, print the ready line, and wait for the end of the process.

        Args:
            addresses: Contents of the ready line: the address of a wire, or the value of a function.
        """
        for wire in self._wires.values():
            await (wire.listen() if isinstance(wire, TcpWire) else wire.plug())
        shown = {name: each() if callable(each) else address_of(each) for name, each in addresses.items()}
        announce(name=self.name, **shown, control=await self.channel.start())
        self.ready = True
        await wait_for_end()

    async def close(self) -> None:
        """Close the wires and the control channel."""
        for call in self._ends:
            result = call()
            if inspect.isawaitable(result):
                await result
        for wire in self._wires.values():
            if isinstance(wire, TcpWire):
                wire.close()
            else:
                with contextlib.suppress(OSError):
                    await wire.unplug()
        await self.channel.close()


def address_of(wire: Wire) -> str:
    """Return HOST:PORT of a TCP port; the path or URL of a serial line."""
    return wire.address if isinstance(wire, TcpWire) else wire.port


def serve(name: str, control: str, body: Callable[[Fake], Awaitable[None]], *, ahead: bool = True) -> int:
    """Run a fake until its end and return the exit status.

    Args:
        name: Name of the fake, for messages.
        control: HOST:PORT of the control channel.
        body: Builds the device and awaits `Fake.run`. A ValueError before that names a wrong option; the status is 2.
        ahead: Whether to request a higher priority; see `process.run`.
    """
    wrong = ""

    async def main() -> None:
        nonlocal wrong
        try:
            fake = Fake(name, ControlServer(*parse_address(control)))
        except ValueError as e:
            wrong = str(e)
            return
        try:
            await body(fake)
        except ValueError as e:
            if fake.ready:
                raise
            wrong = str(e)
        finally:
            await fake.close()

    status = run(main, name, ahead=ahead)
    if wrong:
        sys.stderr.write(f"{name}: {wrong}\n")
        return 2
    return status
