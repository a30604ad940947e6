"""The terminal output of the demo: devices, the current action, finished boards."""

import asyncio
import io
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import httpx
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

_CONNECTION = {"online": "green", "back": "yellow", "connecting": "yellow", "lost": "red", "failed": "red"}
_HISTORY = 6
"""Number of displayed events."""
PICTURE_WIDTH = 84
"""Width of the picture, characters."""


class Display:
    """A live view on a terminal; elsewhere one line per event."""

    def __init__(self, console: Console, boards: int) -> None:
        self._console = console
        self._live: Live | None = None
        self._begin = time.monotonic()
        self._where: dict[str, str] = {}
        self._devices: list[dict[str, Any]] = []
        self._history: list[Text] = []
        self._now = ""
        self._progress = Progress(
            TextColumn("[bold]boards"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[result]}"),
            TimeElapsedColumn(), console=console,
        )  # fmt: skip
        self._task = self._progress.add_task("boards", total=boards, result="")
        self._passed = 0
        self._failed = 0
        self._pictured: list[RenderableType] = []

    def __enter__(self) -> "Display":
        if self._console.is_terminal:
            self._live = Live(self._view(), console=self._console, refresh_per_second=8, transient=False)
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop the live view and keep its last state. May be called again."""
        if self._live is not None:
            self._live.update(self._view())
            self._live.stop()
            self._live = None

    # ------------------------------------------------------------------------------------------------ events
    def note(self, text: str) -> None:
        """Show what is being done."""
        self._now = text
        self._line(Text(text))

    def addresses(self, url: str, devices: Mapping[str, str]) -> None:
        """Show the addresses of the server and the devices."""
        self._where = dict(devices)
        self._line(Text(f"server at {url}; " + ", ".join(f"{name} at {at}" for name, at in devices.items())))

    def action(self, name: str) -> None:
        """Show the running action."""
        self._now = name
        self._line(Text(f"  {name}"))

    def board(self, number: int, of: int, passed: bool) -> None:
        """Show the result of a board."""
        self._passed += passed
        self._failed += not passed
        self._progress.update(self._task, completed=number, result=f"{self._passed} passed, {self._failed} failed")
        verdict = Text("passed", "green") if passed else Text("failed", "red")
        self._line(Text.assemble(f"board {number} of {of}: ", verdict))
        if number == of:
            self._pictured = [self._view()]

    def failed(self, problem: str) -> None:
        """Show the error that ended the program."""
        self._now = ""
        self.close()
        self._out(Text(problem, "red"))

    def finish(self, summary: str, errors: list[str]) -> None:
        """Show the outcome of the run."""
        self._now = ""
        self.close()
        lines = [*(Text(line, "red") for line in errors), Text(summary, "bold")]
        for line in lines:
            self._out(line)
        self._pictured += lines

    def serving(self, url: str) -> None:
        """Show that the server keeps running."""
        page = url.replace("ws", "http", 1)
        self._out(Text(f"The server runs at {url} until Ctrl-C. Open the editor in a browser: {page}"))

    def save_picture(self, file: Path) -> None:
        """Write the view at the last board and the outcome to an SVG file."""
        console = Console(record=True, file=io.StringIO(), width=PICTURE_WIDTH, force_terminal=True)
        console.print(Group(*self._pictured))
        # Without the web fonts of rich, so that the picture loads nothing from the network.
        file.write_text(re.sub(r"@font-face \{.*?\}", "", console.export_svg(title="make run"), flags=re.DOTALL))

    async def follow_devices(self, url: str, period: float) -> None:
        """Read the states of the devices from the server every `period` s, until cancelled."""
        base = url.replace("ws://", "http://", 1).replace("wss://", "https://", 1)
        async with httpx.AsyncClient(base_url=base, timeout=2.0) as client:
            while True:
                try:
                    answer = await client.get("/api/devices")
                    if answer.is_success:
                        self._devices = answer.json()
                        self._refresh()
                except httpx.HTTPError:
                    self._devices = []
                await asyncio.sleep(period)

    def alarms(self) -> list[str]:
        """Return the alarms at the last reading of the devices."""
        return [f"{device['name']}: {alarm['text']}" for device in self._devices for alarm in device.get("alarms", [])]

    # ------------------------------------------------------------------------------------------------ drawing
    def _out(self, text: Text) -> None:
        (self._live.console if self._live is not None else self._console).print(text, highlight=False)

    def _line(self, text: Text) -> None:
        stamped = Text.assemble((f"{time.monotonic() - self._begin:6.1f} s  ", "dim"), text)
        self._history = [*self._history, stamped][-_HISTORY:]
        if self._live is None:
            self._out(stamped)
        self._refresh()

    def _refresh(self) -> None:
        if self._live is not None:
            self._live.update(self._view())

    def _view(self) -> Group:
        devices = Table(box=None, pad_edge=False, show_edge=False)
        for heading in ("device", "type", "address", "connection", "health", "alarms"):
            devices.add_column(heading, header_style="dim")
        known = {device["name"]: device for device in self._devices}
        for name in self._where:
            device = known.get(name)
            if device is None:
                devices.add_row(name, "", self._where.get(name, ""), Text("offline", "dim"), "", "")
                continue
            alarms = "; ".join(alarm["text"] for alarm in device.get("alarms", []))
            connection = device["connection"]
            devices.add_row(
                name,
                device["type"],
                self._where.get(name, ""),
                Text(connection, _CONNECTION.get(connection, "dim")),
                device["health"],
                Text(alarms, "yellow"),
            )
        now = Text.assemble(("now  ", "dim"), (self._now, "bold cyan")) if self._now else Text("")
        return Group(Text("ARCOR2-HW demo cell", "bold"), devices, *self._history, now, self._progress)
