"""The vacuum gripper on a fake I/O block, its carrier."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
from arcor2_drivers.vacuum_gripper.settings import VacuumGripperSettings
from arcor2_drivers.vacuum_gripper.suction_gripper import SuctionGripper
from arcor2_hw.data.device import Connection
from arcor2_hw.exceptions import NotFound
from arcor2_hw.objects import Generic
from arcor2_hw.testing.bench import Bench, Check
from arcor2_hw.testing.life import wait_until
from tests.fakes.conftest import FakeProcess

POINTS = "part=DI0; vacuum=DO0 on_loss=hold; blow=DO1; pressure=AI0 scale=2.5 unit=Pa"
ORPHAN = """
import sys
import time
from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
from arcor2_drivers.vacuum_gripper.settings import VacuumGripperSettings
from arcor2_drivers.vacuum_gripper.suction_gripper import SuctionGripper
host, _, port = sys.argv[1].rpartition(":")
block = RemoteIO("block_id", "block", RemoteIOSettings(host=host, port=int(port), points=sys.argv[2]))
block.connect()
gripper = SuctionGripper("id", "orphan", VacuumGripperSettings("block", "vacuum", "blow", "part"))
gripper.attach(lambda _: block)
gripper.connect()
gripper.take_control()
gripper.on()
time.sleep(60.0)
"""
CARRIER = "valve_block"
NOBODY = "nobody"


class SuctionGripperBench(Bench):
    object_type = SuctionGripper
    address = CARRIER
    fake: FakeProcess
    block: RemoteIO
    nobody: RemoteIO
    other: RemoteIO
    case_over = False

    def start(self) -> None:
        self.fake = FakeProcess("remote_io")
        self.fake.truth()
        self.block = self._block(CARRIER, self.fake.ready["modbus"])
        self.nobody = self._block(NOBODY, "127.99.77.2:502")
        self.other = self._block("other", self.fake.ready["modbus"])

    @staticmethod
    def _block(name: str, address: str) -> RemoteIO:
        host, _, port = address.rpartition(":")
        settings = RemoteIOSettings(host=host, port=int(port), points=POINTS, request_timeout=0.25)
        return RemoteIO(f"{name}_id", name, settings)

    def end(self) -> None:
        self.fake.end()

    def reset(self) -> None:
        """Connect the carrier before a case and disconnect it afterwards; it is not part of the case."""
        self.fake.control.do("heal")
        self.fake.control.do("renew")
        if self.case_over:
            self.case_over = False
        else:
            self.block.connect()

    def release(self) -> None:
        super().release()
        self.block.disconnect()
        self.case_over = True

    def _find(self, name: str) -> Generic:
        for block in (self.block, self.nobody):
            if name == block.name:
                return block
        raise NotFound(f"the scene has no object {name}")

    def _gripper(self, carrier: str, blow_time: float = 8.0) -> SuctionGripper:
        settings = VacuumGripperSettings(carrier, "vacuum", "blow", "part", "pressure", blow_time=blow_time)
        gripper = SuctionGripper("gripper_id", "gripper", settings)
        gripper.attach(self._find)
        return gripper

    def make(self) -> SuctionGripper:
        return self._gripper(CARRIER)

    def absent(self) -> tuple[Generic, str]:
        return self._gripper(NOBODY), NOBODY

    def writes(self) -> object:
        return self.fake.truth()["outputs"]

    def cut(self) -> None:
        self.fake.control.do("silence")

    def heal(self) -> None:
        """Reconnect the carrier, but only after its watchdog has ended the blowing."""
        wait_until(lambda: not self.running(), 3.0, "the watchdog of the carrier")
        self.fake.control.do("heal")
        wait_until(lambda: self.block.connection is not Connection.LOST, 10.0, "the connection of the carrier")

    def observe(self, device: Generic) -> object:
        assert isinstance(device, SuctionGripper)
        return device.part_held()

    def ask(self, device: Generic) -> object:
        assert isinstance(device, SuctionGripper)
        return device.on()

    def command(self, device: Generic) -> object:
        assert isinstance(device, SuctionGripper)
        return device.on()

    def run_long(self, device: Generic) -> object:
        assert isinstance(device, SuctionGripper)
        return device.blow_off()

    def running(self) -> bool:
        return bool(self.fake.truth()["outputs"][1])

    @contextmanager
    def foreign(self) -> Iterator[None]:
        self.other.connect()
        self.other.take_control()
        try:
            yield
        finally:
            self.other.disconnect()

    def orphan(self) -> list[str]:
        return [sys.executable, "-c", ORPHAN, self.fake.ready["modbus"], POINTS]

    def holding(self) -> object:
        return self.fake.truth()["outputs"][0]

    def reset_link(self) -> None:
        self.fake.control.do("reset")

    def half_frame(self) -> None:
        self.fake.control.do("half_frame")

    def readings(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, SuctionGripper)
        self.fake.control.do("set_analog", number=0, raw=24000)
        self.fake.control.do("set_input", number=0, on=True)
        yield Check("the vacuum, Pa", device.vacuum().value, 60_000.0, 1e-6)
        yield Check("a part is held", device.part_held(), True, 0.0)

    def results(self, device: Generic) -> Iterator[Check]:
        assert isinstance(device, SuctionGripper)
        for part, raw in ((True, 24000), (False, 400)):
            self.fake.control.do("set_input", number=0, on=part)
            self.fake.control.do("set_analog", number=0, raw=raw)
            yield Check("is_part_held", device.is_part_held(), part)
            yield Check("measure_vacuum", device.measure_vacuum(), raw * 2.5, 1e-6)

    def works(self, device: Generic) -> dict[str, Callable[[], object]]:
        quick = self._gripper(CARRIER, blow_time=0.3)
        self.keep(quick)

        def blown() -> None:
            quick.connect(self.connect_timeout)
            quick.on()
            quick.blow_off()
            switched = [(each["output"], each["on"]) for each in self.fake.truth()["history"]]
            assert switched == [(0, True), (0, False), (1, True), (1, False)]

        return {"blow_off": blown}
