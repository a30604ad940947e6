"""Start the fake camera: `python -m arcor2_fakes.oak_d`."""

from __future__ import annotations

import asyncio
import importlib.util
import sys
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
from cyclopts import Parameter, validators

from arcor2_fakes.control import parse_address
from arcor2_fakes.oak_d.camera import Camera
from arcor2_fakes.oak_d.optics import Lens
from arcor2_fakes.oak_d.pictures import Pictures
from arcor2_fakes.oak_d.scene import Pose, Scene
from arcor2_fakes.program import program
from arcor2_fakes.serving import Fake
from arcor2_fakes.wire import TcpWire

LOOKING_DOWN: Final = Pose((0.0, 0.0, 0.8), (1.0, 0.0, 0.0, 0.0))
"""Default pose of the camera: above the centre of the table, the top of the image towards +y."""
SWITCHES: Final = {
    "lens_covered": "covered",
    "depth_off": "depth_off",
    "overexposed": "overexposed",
    "frozen": "frozen",
    "wrong_checksum": "wrong_checksum",
}


class StartScene(msgspec.Struct, forbid_unknown_fields=True):
    """The content of the file of --scene."""

    things: list[dict[str, Any]] = []
    camera: dict[str, Any] | None = None
    table_height: float = 0.0


def read_scene(path: Path | None) -> Scene:
    """Read the initial scene. Raises ValueError, which names the file."""
    try:
        given = StartScene() if path is None else msgspec.json.decode(path.read_bytes(), type=StartScene)
        scene = Scene(LOOKING_DOWN, given.table_height)
        if given.camera is not None:
            scene.look_from(given.camera)
        scene.replace(given.things)
    except (OSError, ValueError) as e:
        raise ValueError(f"scene {path}: {e}") from e
    return scene


def register_commands(fake: Fake, camera: Camera, wire: TcpWire, boot_time: float) -> None:
    """Register the commands of the control channel."""
    scene = camera.scene

    def move(name: str | None = None, pose: Any = None, poses: dict[str, Any] | None = None) -> None:
        scene.move({**(poses or {}), **({} if name is None else {name: pose})})

    async def power_cycle(seconds: float | None = None) -> None:
        camera.switch_off()
        wire.refuse()
        await asyncio.sleep(boot_time if seconds is None else seconds)
        await wire.listen()
        camera.switch_on()

    async def heal() -> None:
        for attribute in SWITCHES.values():
            setattr(camera, attribute, False)
        await wire.fault("heal")
        if camera.off:
            camera.switch_on()
        camera.heat(48.0)

    fake.switches(camera, **SWITCHES)
    fake.commands(
        scene=lambda things=(), table_height=None: scene.replace(things, table_height),
        place=lambda thing: scene.place(thing),
        remove=lambda name: scene.remove(name),
        camera=lambda pose: scene.look_from(pose),
        move=move,
        overheat=lambda temperature=96.0: camera.heat(temperature),
        power_cycle=power_cycle,
        heal=heal,  # also the faults of the device
    )


@program("oak_d", "Fake OAK-D: rendered colour and depth over TCP.", ahead=False)
async def main(
    fake: Fake,
    *,
    listen: str = "127.0.0.1:0",
    scene: Path | None = None,
    fps: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=60))] = 30.0,
    width: Annotated[int, Parameter(validator=validators.Number(gte=160, lte=1920))] = 1280,
    height: Annotated[int, Parameter(validator=validators.Number(gte=120, lte=1080))] = 720,
    noise: Annotated[float, Parameter(validator=validators.Number(gte=0, lte=10))] = 1.0,
    boot_time: Annotated[float, Parameter(validator=validators.Number(gte=0, lte=60))] = 1.5,
    time_scale: Annotated[float, Parameter(validator=validators.Number(gt=0, lte=100))] = 1.0,
    seed: int = 0,
) -> None:
    """Start the fake; it prints one line `ready {json}` with its addresses and ends on SIGTERM.

    Args:
        listen: HOST:PORT of the stream; port 0 takes a free one.
        scene: JSON file {"things": [...], "camera": POSE, "table_height": m} of the initial scene.
        fps: frames per second while a client is connected.
        width: width of the images, pixels.
        height: height of the images, pixels.
        noise: factor of the usual noise; 0 for none.
        boot_time: duration of a power cycle, s.
        time_scale: how many times faster than real time it boots.
        seed: seed of the noise.
    """
    start_scene = read_scene(scene)
    for module in ("open3d", "cv2"):
        if importlib.util.find_spec(module) is None:
            raise ModuleNotFoundError(f"{module} is not installed; it comes with the extra `vision`")

    lens = Lens(width, height)
    pictures = Pictures(lens, noise, seed)
    camera = Camera(start_scene, lens, fps, pictures.warm, pictures.take)
    wire = TcpWire("stream", *parse_address(listen), camera.opened)
    fake.wires(stream=wire)
    register_commands(fake, camera, wire, boot_time / time_scale)
    fake.truth(lambda: {**camera.truth(), "rendered": pictures.rendered})
    fake.at_end(camera.stop)
    camera.start()
    await fake.run(stream=wire)


if __name__ == "__main__":
    sys.exit(main())
