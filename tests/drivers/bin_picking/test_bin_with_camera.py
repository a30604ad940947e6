"""A bin with a camera: fake, stream, driver, and the links of a program from picture to robot."""

from collections.abc import Iterator

import msgspec
import pytest

from arcor2_drivers.bin_picking.bin import Bin
from arcor2_drivers.bin_picking.errors import Empty
from arcor2_drivers.bin_picking.settings import BinSettings
from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import OakDSettings
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.runtime.values import decode_arguments, results
from tests.fakes.conftest import FakeProcess

from .conftest import CRATE, HEIGHT, LENGTH, PART, WIDTH, at, crate, encoded, part, turned

HANGING = Pose(Position(0.02, 0.01, 0.7), Orientation(1.0, 0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def fake() -> Iterator[FakeProcess]:
    running = FakeProcess("oak_d", "--width", "640", "--height", "360")  # a busy machine renders few larger pictures
    running.control.do("camera", pose=encoded(HANGING))
    yield running
    running.end()


def test_a_program_links_picture_part_and_robot(fake: FakeProcess) -> None:
    camera = OakD(
        "camera_id", "camera", HANGING, None, OakDSettings(fake.ready["stream"], max_age=5.0, frame_timeout=10.0)
    )
    box = Bin("bin_id", "crate", CRATE, BinSettings(LENGTH, WIDTH, HEIGHT, *PART))
    truth = at(-0.04, 0.03, PART[2] / 2, turned(z=64))
    try:
        camera.connect(20.0)
        box.connect()
        fake.control.do("scene", things=[*crate(), part("a", truth)])
        # Like a link online: the result of an action as JSON is the argument of the next.
        [depth] = results(camera.depth_image(4))
        part_, quality = results(box.next_part(**decode_arguments(box.next_part, {"depth": depth.encode()}, "crate")))
        arguments = {"part": part_.encode(), "above": b"0.1"}
        [tool] = results(box.grip_pose(**decode_arguments(box.grip_pose, arguments, "crate")))
        found, over = msgspec.json.decode(part_, type=Pose), msgspec.json.decode(tool, type=Pose)
        off = 1000.0 * found.position.distance_to(truth.position)
        print(f"off by {off:.2f} mm, quality {quality}")  # noqa: T201
        assert off < 1.2  # a pixel of this picture is 1.4 mm on the floor
        assert float(quality) > 0.95
        assert over.position.distance_to(at(-0.04, 0.03, PART[2] + 0.1).position) < 0.001
        fake.control.do("remove", name="a")
        with pytest.raises(Empty):
            box.next_part(camera.depth_image())
    finally:
        camera.disconnect()
        box.disconnect()
