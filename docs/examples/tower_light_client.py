"""Shows on a tower light what a server does. `python tower_light_client.py --help`; docs/how-to/follow-a-server.md."""

import asyncio
import logging

import cyclopts

from arcor2_drivers.remote_io.settings import TowerLightSettings
from arcor2_drivers.remote_io.tower_light import TowerLight
from arcor2_hw.client import Client, EventsMissed
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.objects.machine import MachineStateName

# An error, a program running, one paused; without a program: a scene online, none online, no server.
LAMPS = "aborted=red blinking; execute=green; held=amber; idle=green blinking; stopped=off; suspended=amber blinking"
PROGRAM = {"pausing": "held", "paused": "held", "stopped": "", "undefined": ""}  # every other state: execute


def show(light: TowerLight, state: str) -> None:
    """Show a state; control of the lamps is taken first, also again after the block was away."""
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
        except EventsMissed:  # what is so now is told next, as at first
            program, scene = "", "stopped"
        except TimeoutError:  # nothing happened; but the server, or the light, may be gone
            pass
        state = (program or scene) if client.connected else "suspended"
        try:
            if state != shown or light.control_owner() != "us":
                await asyncio.to_thread(show, light, state)
                shown = state
        except Arcor2Error as error:  # tried again in half a second
            logging.warning("%s", error)


async def main(block: str, port: int = 502, url: str = "ws://127.0.0.1:6789") -> None:
    """Follow the server at URL; lamps are at the outputs 0 (red), 1 (amber) and 2 (green) of the block."""
    settings = TowerLightSettings(block, port, red="DO0", amber="DO1", green="DO2", on_loss="red", patterns=LAMPS)
    light = TowerLight("light", "light", settings)
    await asyncio.to_thread(light.connect)
    async with Client(url, connect_within=float("inf")) as client:
        await follow(client, light)


cyclopts.run(main)
