"""MapFake: a device that behaves as its map states, for first steps with a driver generated from the same map.

It is not independent of the driver: an error of the map is in both. Not modelled: everything that is not in the map.
"""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import yaml

from arcor2_fakes.register_map import Place
from arcor2_fakes.registers import HOST, NOBODY, PANEL, MappedDevice, Refusal, serve_device

SECONDS = 0.3
"""Duration of a command, s."""
PATIENCE = {"holds": 0.5, "continues": math.inf}
"""Time without a request after which a command ends, by reaction to a connection loss, s."""


class MapFake(MappedDevice):
    """A device whose commands all take the same time.

    Args:
        content: The map (docs/reference/modbus-map.md).
    """

    def __init__(self, content: dict[str, Any]) -> None:
        self._content, points = content, content["points"]
        self._texts = {name: {v: k for k, v in point.get("values", {}).items()} for name, point in points.items()}
        low_first = content.get("word_order") == "low_first"
        self.places = {  # type: ignore[misc] # of this device
            name: Place(
                f"{point['table']}s",
                point["address"],
                point.get("type", "uint16"),
                point["word_order"] == "low_first" if "word_order" in point else low_first,
                point.get("bit"),
            )
            for name, point in points.items()
        }
        control = content.get("control", {})
        self._take, self._release = (self._numbers(control.get(key, {})) for key in ("take", "release"))
        self._stop = self._numbers(content.get("stop", {}))
        self._owner = control.get("owner", "")
        self.unrecorded = (control.get("heartbeat", {}).get("point", ""),)  # type: ignore[misc]
        loss = content["loss_reaction"]
        self._patience = loss["stops_within"] / 2 if isinstance(loss, dict) else PATIENCE[loss]
        super().__init__()

    def power_on(self) -> None:
        """Initialize the state that is not in registers; the device is not busy."""
        self.seconds = SECONDS
        self._end: dict[str, Any] | None = None
        self._commands = [self._command(each) for each in self._content.get("commands", {}).values()]
        busy = self._numbers(self._content.get("busy", {}))
        for *_, end in self._commands if busy and self._has(busy) else ():
            vars(self.registers).update(end)

    def _command(self, command: dict[str, Any]) -> tuple[str, dict[str, Any], dict[str, Any], dict[str, Any]]:
        """Return the last written point of a command, all its writes, and the values at its start and end."""
        busy, start = self._content.get("busy", {}), command.get("write", {})
        last = [*command.get("parameters", []), *start][-1]
        done = command.get("done", {}).get("when", {})
        end = {**done, **command.get("ok", {})}
        ends_busy = any(end.get(name, value) != value for name, value in busy.items())
        begin = {name: not value for name, value in done.items() if isinstance(value, bool)}
        begin |= {**command.get("acknowledge", {}).get("when", {}), **(busy if ends_busy else {})}
        return last, self._numbers(start), self._numbers(begin), self._numbers(end)

    def _numbers(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return the register contents for values."""
        points = self._content["points"]
        return {
            name: self._texts[name].get(value, value / points[name]["scale"] if "scale" in points[name] else value)
            for name, value in values.items()
        }

    @property
    def busy(self) -> bool:
        """Return whether a command runs."""
        return self._end is not None

    def last(self, seconds: float) -> None:
        """Set the duration of commands, s."""
        self.seconds = seconds

    def rest(self) -> None:
        """Reset to the state after power on."""
        self.__init__(self._content)  # type: ignore[misc]

    def advance(self, now: float) -> None:
        """End the command when its duration has elapsed."""
        if now - self.began >= self.seconds:
            self.let_go()

    def let_go(self) -> None:
        """End the command."""
        vars(self.registers).update(self._end or {})
        self._end = None

    def update(self) -> None:
        """Advance the simulation to the present."""
        super().update()
        if self._owner:
            numbers = self._texts[self._owner]
            panel = next((number for text, number in numbers.items() if text not in ("us", "nobody")), 0)
            vars(self.registers)[self._owner] = {NOBODY: numbers["nobody"], HOST: numbers["us"], PANEL: panel}[
                self.owner
            ]

    def changed(self, name: str, value: Any) -> None:  # noqa: ARG002 - it is in `registers`
        """Take or release control, start a command, or stop."""
        if name in self._take and self._has(self._take):
            self.guard(self._patience)
        elif name in self._release and self._has(self._release):
            self.guard(0.0)
        for last, start, begin, end in self._commands:
            if name == last and self._has(start):
                if self.busy or (self._take and self.owner != HOST):
                    raise Refusal("busy" if self.busy else "nobody has control")
                if not self._take:
                    self.guard(self._patience)
                self._end, self.began = end, time.monotonic()
                vars(self.registers).update(begin)
                return
        if name in self._stop and self._has(self._stop):
            self.let_go()

    def truth(self) -> dict[str, Any]:
        """Return the real state, for tests; `done` is the completed fraction of the command, 0 to 1."""
        done = (time.monotonic() - self.began) / self.seconds if self.busy else 1.0
        return super().truth() | {"done": done}

    def _has(self, numbers: dict[str, Any]) -> bool:
        return all(getattr(self.registers, name) == number for name, number in numbers.items())


def serve_map(name: str, file: Path) -> int:
    """Run the fake of a map until the end of the process; return the exit status."""
    content = yaml.safe_load(file.read_text(encoding="utf-8"))
    return serve_device(name, lambda: MapFake(content), "modbus", "last")
