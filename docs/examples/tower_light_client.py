"""Show the state of a server on a tower light. See docs/how-to/follow-a-server.md; options: --help."""

import asyncio
import logging

import cyclopts

from arcor2_drivers.remote_io.settings import TowerLightSettings
from arcor2_drivers.remote_io.tower_light import TowerLight
from arcor2_hw.client import Client, EventsMissed
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.objects.machine import MachineStateName

# Program: failed, running, paused. Without a program: scene online, scene offline, no connection to the server.
LAMPS = "aborted=red blinking; execute=green; held=amber; idle=green blinking; stopped=off; suspended=amber blinking"
PROGRAM = {"pausing": "held", "paused": "held", "stopped": "", "undefined": ""}  # every other state: execute


def show(light: TowerLight, state: str) -> None:
    """Take control of the lamps if necessary, also after a connection loss, and show a state."""
    light.take_control()
    light.show_state(MachineStateName(state))


async def follow(client: Client, light: TowerLight) -> None:
    """Follow the server until cancelled."""
    program, scene, shown = "", "stopped", ""
    while True:
        try:
            event = await asyncio.wait_for(anext(client.events()), 0.5)
            if event.event == "ProjectException" and not event.data.handled:
                program = "aborted"  # until another one starts
            elif event.event == "PackageState" and (program != "aborted" or event.data.state == "started"):
                program = PROGRAM.get(event.data.state, "execute")
            elif event.event == "SceneState":
                scene = "idle" if event.data.state == "started" else "stopped"
        except EventsMissed:  # the server sends the current state next, as after connecting
            program, scene = "", "stopped"
        except TimeoutError:  # no event; the server or the light may still have disconnected
            pass
        state = (program or scene) if client.connected else "suspended"
        try:
            if state != shown or light.control_owner() != "us":
                await asyncio.to_thread(show, light, state)
                shown = state
        except Arcor2Error as error:  # the next iteration tries again, after at most 0.5 s
            logging.warning("%s", error)


async def main(block: str, port: int = 502, url: str = "ws://127.0.0.1:6789") -> None:
    """Follow the server at URL; lamps are at the outputs 0 (red), 1 (amber) and 2 (green) of the block."""
    settings = TowerLightSettings(block, port, red="DO0", amber="DO1", green="DO2", on_loss="red", patterns=LAMPS)
    light = TowerLight("light", "light", settings)
    await asyncio.to_thread(light.connect)
    async with Client(url, connect_within=float("inf")) as client:
        await follow(client, light)


cyclopts.run(main)
