"""Links between drivers and fakes, one for each transport: how to interrupt and restore them, and detect recovery.

The drivers have their default settings. A reading is fresh if it shows a state that the device took after the link was
restored, or if it was taken after that.
"""

import contextlib
import os
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from arcor2_drivers.abb_yumi.settings import YumiSettings
from arcor2_drivers.abb_yumi.yumi import YuMi
from arcor2_drivers.barcode_reader.barcode_reader import BarcodeReader
from arcor2_drivers.barcode_reader.settings import BarcodeReaderSettings
from arcor2_drivers.conveyor.conveyor import Conveyor
from arcor2_drivers.conveyor.settings import CanInterface, ConveyorSettings
from arcor2_drivers.dobot_magician.dobot_magician import DobotMagician
from arcor2_drivers.dobot_magician.settings import DobotMagicianSettings
from arcor2_drivers.erp.erp_service import ErpService
from arcor2_drivers.erp.settings import ErpSettings
from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.functional_tester.settings import FunctionalTesterSettings
from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import OakDSettings
from arcor2_drivers.opcua_plc.opcua_plc import OpcUaPlc
from arcor2_drivers.opcua_plc.settings import OpcUaPlcSettings
from arcor2_drivers.remote_io.remote_io import RemoteIO
from arcor2_drivers.remote_io.settings import RemoteIOSettings
from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.robotiq_2f.settings import Robotiq2FSettings, Wire
from arcor2_drivers.scale.mt_sics_scale import MtSicsScale
from arcor2_drivers.scale.settings import MtSicsScaleSettings
from arcor2_drivers.two_axis_robot.settings import TwoAxisRobotSettings
from arcor2_drivers.two_axis_robot.two_axis_robot import TwoAxisRobot
from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_drivers.vacuum_gripper.settings import VacuumGripperSettings
from arcor2_drivers.vacuum_gripper.suction_gripper import SuctionGripper
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.objects import Generic
from arcor2_server.demo.fakes import free_loopback_address
from tests.fakes.conftest import FakeProcess

Kind = Literal["reset", "silence", "half-open"]
KINDS: Final[tuple[Kind, ...]] = ("reset", "silence", "half-open")
Fresh = Callable[[Any], bool]
"""Returns whether a reading was taken after the link was restored."""

UR_PORTS: Final = (29999, 30003, 30004)
YUMI_PORTS: Final = (8080, 6101, 6102, 6111, 6112)
UR_HOME: Final = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0]
YUMI_HOME: Final = [0.0, -130.0, 30.0, 0.0, 40.0, 0.0, 135.0]
LEVEL: Final = "level=AI ns=2;s=Cell.Level"


@dataclass
class Link:
    """A driver connected to its fake.

    Attributes:
        read: Take a reading.
        mark: Change the state of the device and return a check for that state; `n` differs at each call.
        serial: The link is a port that can be unplugged.
        others: Other objects that have to be connected.
    """

    name: str
    fake: FakeProcess
    device: Generic
    read: Callable[[], Any]
    mark: Callable[[int], Fresh]
    serial: bool = False
    others: tuple[Generic, ...] = ()

    @property
    def objects(self) -> tuple[Generic, ...]:
        return (*self.others, self.device)

    def interrupt(self, kind: Kind) -> None:
        """Interrupt the link.

        Reset closes it and refuses new connections. Silence passes no data. Half-open suspends the device's process,
        while its kernel still acknowledges data and accepts connections.
        """
        if kind == "half-open":
            os.kill(self.fake.process.pid, signal.SIGSTOP)
        elif kind == "silence":
            self.fake.control.do("silence")
        else:
            self.fake.control.do("refuse")  # unplugging a port also closes it
            if not self.serial:
                self.fake.control.do("reset")

    def restore(self, kind: Kind) -> None:
        if kind == "half-open":
            os.kill(self.fake.process.pid, signal.SIGCONT)
        else:
            self.fake.control.do("heal")


def _host(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    return host, int(port)


def _odd(n: int) -> bool:
    return bool(n % 2)


def _is(value: Any) -> Fresh:
    return lambda found: bool(found == value)


def _near(value: float, within: float) -> Fresh:
    return lambda found: abs(found - value) < within


def _since_now() -> Fresh:
    now = time.monotonic()
    return lambda taken: bool(taken > now)


class Links:
    """Starts fakes and creates drivers for them, not connected."""

    def __init__(self, stack: contextlib.ExitStack, folder: Path) -> None:
        self._stack, self._folder = stack, folder

    def all(self) -> Iterator[Link]:
        yield self._tester()
        yield self._block("Modbus TCP")
        yield self._block("Modbus RTU", "--serial", "--link", str(self._folder / "tty_block"))
        yield self._suction()
        yield self._robotiq("ASCII")
        yield self._robotiq("Modbus RTU")
        yield self._conveyor("slcan")
        yield self._conveyor("socketcand")
        yield self._ur()
        yield self._yumi()
        yield self._dobot()
        yield self._two_axis()
        yield self._scale()
        yield self._printer()
        yield self._reader()
        yield self._erp()
        yield self._plc()
        yield self._camera()

    def _start(self, module: str, *arguments: str) -> FakeProcess:
        fake = FakeProcess(module, *arguments)
        self._stack.callback(fake.end)
        fake.truth()  # opens the control channel before descriptors are counted
        return fake

    def _linked(self, module: str, *arguments: str) -> FakeProcess:
        """Start a fake on a pseudo terminal whose path stays the same after it is plugged in again."""
        return self._start(module, "--link", str(self._folder / f"tty_{module}"), *arguments)

    def _tester(self) -> Link:
        fake = self._start("functional_tester", "--seed", "1", "--time-scale", "10")
        fake.control.do("push_door", opening=True)
        fake.control.wait_until(lambda truth: truth["door"] == "open")
        settings = FunctionalTesterSettings(*_host(fake.ready["modbus"]))
        device = FunctionalTester("tester", "tester", Pose(), None, settings)

        def mark(n: int) -> Fresh:
            if _odd(n):
                fake.control.do("put_board", code=f"B-{n}")
            else:
                fake.control.do("take_board")
            return _is(_odd(n))

        return Link("FunctionalTester, Modbus TCP", fake, device, device.board_present, mark)

    def _remote_io(self, name: str, fake: FakeProcess, points: str) -> RemoteIO:
        address = str(fake.ready["modbus"])
        if address.startswith("/"):
            settings = RemoteIOSettings(serial_port=address, points=points)
        else:
            settings = RemoteIOSettings(*_host(address), points=points)
        return RemoteIO(name, name, settings)

    @staticmethod
    def _input(fake: FakeProcess) -> Callable[[int], Fresh]:
        def mark(n: int) -> Fresh:
            fake.control.do("set_input", number=0, on=_odd(n))
            return _is(_odd(n))

        return mark

    def _block(self, transport: str, *arguments: str) -> Link:
        fake = self._start("remote_io", *arguments)
        block = self._remote_io("block", fake, "part=DI0")
        name = f"RemoteIO, {transport}"
        return Link(name, fake, block, lambda: block.read("part").value, self._input(fake), bool(arguments))

    def _suction(self) -> Link:
        fake = self._start("remote_io")
        block = self._remote_io("valves", fake, "part=DI0; vacuum=DO0 on_loss=hold; blow=DO1")
        gripper = SuctionGripper("suction", "suction", VacuumGripperSettings("valves", "vacuum", "blow", "part"))
        gripper.attach(lambda _: block)
        name = "SuctionGripper, Modbus TCP of its block"
        return Link(name, fake, gripper, gripper.part_held, self._input(fake), others=(block,))

    def _robotiq(self, transport: str) -> Link:
        fake = self._start("robotiq_2f", "--link", str(self._folder / f"tty_2f_{transport[:3]}"))
        serial = transport != "ASCII"
        if serial:
            settings = Robotiq2FSettings(wire=Wire.MODBUS_RTU, serial_port=fake.ready["rtu"])
        else:
            host, port = _host(fake.ready["ascii"])
            settings = Robotiq2FSettings(host=host, port=port)
        gripper = Robotiq2F("gripper", f"gripper_{transport[:3]}", settings)

        def mark(n: int) -> Fresh:
            fake.control.do("fault", code=8 if _odd(n) else 0)
            return _is(["8"] if _odd(n) else [])

        return Link(
            f"Robotiq2F, {transport}", fake, gripper, lambda: [alarm.code for alarm in gripper.alarms()], mark, serial
        )

    def _conveyor(self, interface: str) -> Link:
        fake = self._start("conveyor")
        if interface == "slcan":
            settings = ConveyorSettings(f"socket://{fake.ready['can']}")
        else:
            channel = f"socket://{fake.ready['socketcand']}/can0"
            settings = ConveyorSettings(channel, CanInterface.SOCKETCAND)
        belt = Conveyor("belt", f"belt_{interface}", settings)
        return Link(f"Conveyor, {interface}", fake, belt, lambda: belt.position().monotonic, lambda _: _since_now())

    def _ur(self) -> Link:
        host = free_loopback_address(UR_PORTS)
        fake = self._start("ur", "--host", host, "--control", "127.0.0.1:0")
        arm = UR5e("ur", "ur", Pose(), UrSettings(host, payload_mass=1.0))

        def mark(n: int) -> Fresh:
            base = 0.2 if _odd(n) else -0.2
            fake.control.do("place", q=[base, *UR_HOME[1:]])
            return _near(base, 0.01)

        return Link("UR5e, RTDE", fake, arm, lambda: arm.robot_joints()[0].value, mark)

    def _yumi(self) -> Link:
        host = free_loopback_address(YUMI_PORTS)
        fake = self._start("abb_yumi", "--host", host)
        robot = YuMi("yumi", "yumi", Pose(), YumiSettings(host, rws_port=YUMI_PORTS[0], left_mass=0.2, right_mass=0.2))

        def mark(n: int) -> Fresh:
            degrees = 10.0 if _odd(n) else -10.0
            fake.control.do("place", arm="left", joints=[*YUMI_HOME[:5], degrees, YUMI_HOME[6]])
            return _near(degrees / 57.3, 0.01)

        return Link("YuMi, RWS", fake, robot, lambda: robot.robot_joints(arm_id="left")[5].value, mark)

    def _dobot(self) -> Link:
        fake = self._linked("dobot_magician")
        arm = DobotMagician("dobot", "dobot", Pose(), DobotMagicianSettings(fake.ready["port"]))

        def mark(n: int) -> Fresh:
            fake.control.do("drive", turn=5.0 if _odd(n) else -5.0, percent=100.0)
            return _near(5.0 / 57.3 if _odd(n) else 0.0, 0.02)

        return Link("DobotMagician, serial", fake, arm, lambda: arm.robot_joints()[0].value, mark, serial=True)

    def _two_axis(self) -> Link:
        fake = self._linked("two_axis_robot")
        arm = TwoAxisRobot("two_axis", "two_axis", Pose(), TwoAxisRobotSettings(fake.ready["port"]))

        def mark(n: int) -> Fresh:
            fake.control.do("place", servo=1, ticks=2500 if _odd(n) else 1600)
            return lambda angle: bool((angle > 0.0) == _odd(n))

        return Link("TwoAxisRobot, Dynamixel", fake, arm, lambda: arm.robot_joints()[0].value, mark, serial=True)

    def _scale(self) -> Link:
        fake = self._linked("scale", "--settling", "0.05")
        scale = MtSicsScale("scale", "scale", settings=MtSicsScaleSettings(fake.ready["port"]))

        def mark(n: int) -> Fresh:
            kg = 0.5 if _odd(n) else 0.2
            fake.control.do("put", kg=kg)
            return _near(kg, 1e-3)

        return Link("MtSicsScale, serial", fake, scale, lambda: scale.weigh().value, mark, serial=True)

    def _printer(self) -> Link:
        fake = self._start("label_printer", "--tcp", "127.0.0.1:0")
        printer = ZplPrinter("printer", "printer", settings=ZplPrinterSettings(fake.ready["port"]))

        def mark(n: int) -> Fresh:
            fake.control.do("pause", on=_odd(n))
            return _is("paused" if _odd(n) else "ready")

        return Link("ZplPrinter, socket://", fake, printer, printer.status, mark)

    def _reader(self) -> Link:
        fake = self._linked("barcode_reader")
        reader = BarcodeReader("reader", "reader", settings=BarcodeReaderSettings(fake.ready["port"]))

        def mark(n: int) -> Fresh:
            fake.control.do("present", code=f"C-{n}")
            return _is(f"C-{n}")

        def read() -> str:
            return getattr(reader.trigger(0.5), "text", "")

        return Link("BarcodeReader, serial", fake, reader, read, mark, serial=True)

    def _erp(self) -> Link:
        fake = self._start("erp")
        erp = ErpService("erp", "erp", ErpSettings(fake.ready["url"], outbox=str(self._folder / "outbox")))

        def mark(n: int) -> Fresh:
            fake.control.do("add_order", order=f"O-{n}", product="board")
            return _is(f"O-{n}")

        def read() -> str:
            found, order, *_ = erp.next_order(0.0)
            if found:
                erp.close_order(order, "read")
            return order

        return Link("ErpService, HTTP", fake, erp, read, mark)

    def _plc(self) -> Link:
        fake = self._start("opcua_plc")
        plc = OpcUaPlc("plc", "plc", OpcUaPlcSettings(fake.ready["url"], LEVEL))

        def mark(n: int) -> Fresh:
            fake.control.do("set", name="Level", value=n)
            return _is(n)

        return Link("OpcUaPlc, OPC UA", fake, plc, lambda: plc.read("level").value, mark)

    def _camera(self) -> Link:
        fake = self._start("oak_d", "--width", "320", "--height", "180")
        pose = Pose(Position(0.0, 0.0, 0.8), Orientation(1.0, 0.0, 0.0, 0.0))
        camera = OakD("camera", "camera", pose, None, OakDSettings(fake.ready["stream"]))
        return Link("OakD, stream", fake, camera, lambda: camera.capture().monotonic, lambda _: _since_now())


@contextlib.contextmanager
def started() -> Iterator[list[Link]]:
    """Start every fake and yield the links, not connected; disconnect and stop all at the end."""
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="arcor2-hw-links-", ignore_cleanup_errors=True))
        yield list(Links(stack, Path(folder)).all())
