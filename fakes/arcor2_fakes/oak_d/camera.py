"""The camera: clients, frames, settings and simulated faults."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Any, Final

import msgspec

from arcor2_fakes.oak_d.optics import Lens
from arcor2_fakes.oak_d.scene import Scene
from arcor2_fakes.oak_d.stream import BadMessage, Kind, Questions, encode
from arcor2_fakes.wire import Connection

IDENTITY: Final = {"vendor": "Luxonis", "model": "OAK-D (fake)", "serial": "FAKE000000000001", "firmware": "fake 1.0"}
NORMAL_EXPOSURE: Final = 0.01
EXPOSURES: Final = (0.000001, 0.033)
"""Shortest and longest exposure time of the colour camera, s."""
DEPTH_RANGE: Final = (0.2, 10.0)
STATUS_PERIOD: Final = 1.0
ROOM_TEMPERATURE: Final = 48.0
"""Usual temperature of the chip, °C."""
SHUTDOWN: Final = 105.0
"""Temperature at which the chip switches itself off, °C."""
OVEREXPOSED: Final = 12.0

log = logging.getLogger(__name__)


class Client:
    """A connected client; it receives frames from its start message on."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.color: str | None = None
        self.name = ""


class Camera:
    """The camera without its port. `render` returns images, `warm` prepares it; both run on other threads."""

    def __init__(
        self,
        scene: Scene,
        lens: Lens,
        fps: float,
        warm: Callable[[], None],
        render: Callable[[Scene, int, float, bool], tuple[Callable[[str], bytes], bytes]],
    ) -> None:
        self.scene, self.lens, self.fps = scene, lens, fps
        self._warm, self._render = warm, render
        self._clients: set[Client] = set()
        self._task: asyncio.Task[None] | None = None
        self._news = asyncio.Event()
        self._told_status = 0.0
        self._booted = time.monotonic()
        self.off = False
        self.exposure: float | None = None
        self.temperature = ROOM_TEMPERATURE
        self.covered = self.depth_off = self.overexposed = self.frozen = self.wrong_checksum = False
        self.received: list[dict[str, Any]] = []
        self.frames = 0
        self.clients_ever = 0

    # ------------------------------------------------------------------------------------------------ clients
    def opened(self, connection: Connection) -> None:
        """Send a new client the hello."""
        client = Client(connection)
        questions = Questions(lambda kind, header: self._asked(client, kind, header))

        def received(data: bytes) -> None:
            try:
                questions.feed(data)
            except BadMessage as e:
                self._say(client, Kind.REFUSED, {"reason": str(e)})
                connection.close()

        def closed() -> None:
            self._clients.discard(client)
            self._news.set()

        connection.received, connection.closed = received, closed
        if self.off:
            connection.reset()
            return
        self._clients.add(client)
        self.clients_ever += 1
        hello = {
            **IDENTITY,
            "width": self.lens.width,
            "height": self.lens.height,
            "fps": self.fps,
            "depth_range": DEPTH_RANGE,
        }
        self._say(client, Kind.HELLO, hello, msgspec.json.encode(self.lens.eeprom(IDENTITY["serial"])))

    @property
    def watchers(self) -> list[Client]:
        """Return the clients that receive frames."""
        return [client for client in self._clients if client.color is not None]

    def _asked(self, client: Client, kind: Kind, header: dict[str, Any]) -> None:
        if kind is Kind.START:
            if header.get("color") not in ("bgr", "jpeg"):
                raise BadMessage("color must be bgr or jpeg")
            client.name, client.color = str(header.get("client", "")), header["color"]
            self._say_status(client)
            self._news.set()
        elif kind is Kind.CLOCK:
            self._say(client, Kind.CLOCK, {"asked": header.get("asked"), "at": self.clock()})
        elif kind is Kind.CONTROL:
            self.received.append(header)
            exposure = header.get("exposure")
            if exposure is None:
                self.exposure = None
            elif isinstance(exposure, int | float) and EXPOSURES[0] <= exposure <= EXPOSURES[1]:
                self.exposure = float(exposure)
            else:
                self._say(client, Kind.REFUSED, {"reason": f"exposure {exposure!r} is not within {EXPOSURES} s"})
                return
            self.send_status()
        else:
            raise BadMessage(f"a client must not send {kind.name}")

    def _say(self, client: Client, kind: Kind, header: dict[str, Any], payload: bytes = b"") -> bool:
        return client.connection.send(encode(kind, header, payload, wrong_checksum=self.wrong_checksum))

    def _say_status(self, client: Client) -> None:
        self._say(client, Kind.STATUS, {"temperature": self.temperature, "exposure": self.exposure})

    def send_status(self) -> None:
        """Send the status to all clients that receive frames."""
        self._told_status = time.monotonic()
        for client in self.watchers:
            self._say_status(client)

    # ------------------------------------------------------------------------------------------------ frames
    def clock(self) -> float:
        """Return the clock of the camera: time since power-on, s."""
        return time.monotonic() - self._booted

    def start(self) -> None:
        """Start sending frames."""
        self._task = asyncio.create_task(self._run(), name="frames")

    async def stop(self) -> None:
        """Stop sending frames."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _run(self) -> None:
        await asyncio.to_thread(self._warm)
        due = time.monotonic()
        last: dict[str, Any] = {}
        while True:
            if not self.watchers or self.off:
                self._news.clear()
                await self._news.wait()
                due = time.monotonic()
                continue
            if not (self.frozen and last):
                last = {"number": self.frames, "stamp": self.clock(), "exposure": self.exposure or NORMAL_EXPOSURE}
            bright = OVEREXPOSED * NORMAL_EXPOSURE if self.overexposed else last["exposure"]
            variant = 0 if self.frozen else self.frames
            try:
                color, depth = await asyncio.to_thread(self._render, self.scene, variant, bright, self.covered)
                self._send(last, color, b"" if self.depth_off else depth)
            except ValueError as e:  # an invalid mesh or marker
                log.error("the scene cannot be rendered: %s", e)
                await asyncio.sleep(0.5)
            if time.monotonic() - self._told_status > STATUS_PERIOD:
                self.send_status()
            due = max(due + 1.0 / self.fps, time.monotonic() - 1.0 / self.fps)
            await asyncio.sleep(max(0.0, due - time.monotonic()))

    def _send(self, common: dict[str, Any], color: Callable[[str], bytes], depth: bytes) -> None:
        messages: dict[str, bytes] = {}
        for client in self.watchers:
            form = str(client.color)
            if form not in messages:
                picture = color(form)
                header = {**common, "color": form, "color_bytes": len(picture), "depth_bytes": len(depth)}
                messages[form] = encode(Kind.FRAME, header, picture + depth, wrong_checksum=self.wrong_checksum)
            client.connection.send(messages[form])
        self.frames += 1

    # ------------------------------------------------------------------------------------------------ simulated world
    def heat(self, temperature: float) -> None:
        """Set the chip temperature, °C; at SHUTDOWN it switches itself off until `power_cycle`."""
        if not -40.0 <= temperature <= 150.0:
            raise ValueError("temperature must be -40 to 150")
        self.temperature = float(temperature)
        self.send_status()
        if self.temperature >= SHUTDOWN:
            self.switch_off()

    def switch_off(self) -> None:
        """Simulate power loss."""
        self.off = True
        for client in tuple(self._clients):
            client.connection.reset()

    def switch_on(self) -> None:
        """Restore power: clock, frame numbers, exposure and temperature are reset."""
        self.off = False
        self._booted = time.monotonic()
        self.frames = 0
        self.exposure = None
        self.received.clear()
        self.temperature = ROOM_TEMPERATURE
        self._news.set()

    def truth(self) -> dict[str, Any]:
        """Return the real state, for tests."""
        return {
            "things": msgspec.to_builtins(self.scene.things),
            "camera": msgspec.to_builtins(self.scene.camera),
            "table_height": self.scene.table_height,
            "clients": len(self._clients),
            "clients_ever": self.clients_ever,
            "watching": [client.name for client in self.watchers],
            "frames": self.frames,
            "exposure": self.exposure,
            "temperature": self.temperature,
            "received": self.received[-100:],
            "off": self.off,
        }
