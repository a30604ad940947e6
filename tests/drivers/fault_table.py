"""All faults that a fake can inject, each with its alarm."""

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np
from PIL import Image

from arcor2_drivers.abb_yumi.hands import ArmId
from arcor2_drivers.bin_picking.bin import Bin
from arcor2_drivers.erp.erp_service import ErpService
from arcor2_drivers.erp.settings import ErpSettings
from arcor2_drivers.functional_tester.functional_tester import FunctionalTester
from arcor2_drivers.label_printer.settings import ZplPrinterSettings
from arcor2_drivers.label_printer.zpl_printer import ZplPrinter
from arcor2_drivers.robotiq_2f.robotiq_2f import Robotiq2F
from arcor2_drivers.scale.mt_sics_scale import MtSicsScale
from arcor2_drivers.scale.settings import MtSicsScaleSettings
from arcor2_hw.objects import Generic, MachineCommand, MachineState
from arcor2_hw.objects.frame import PictureNote
from arcor2_hw.testing.bench import Bench
from arcor2_hw.testing.life import wait_until
from tests.drivers.benches.abb_yumi_bench import YuMiBench
from tests.drivers.benches.barcode_reader_bench import BarcodeReaderBench
from tests.drivers.benches.bin_picking_bench import BinBench, BlisterBench, picture
from tests.drivers.benches.conveyor_bench import ConveyorBench
from tests.drivers.benches.dobot_magician_bench import DobotMagicianBench
from tests.drivers.benches.erp_bench import ErpServiceBench
from tests.drivers.benches.functional_tester_bench import FunctionalTesterBench
from tests.drivers.benches.label_printer_bench import ZplPrinterBench
from tests.drivers.benches.oak_d_bench import OakDBench
from tests.drivers.benches.opcua_plc_bench import OpcUaPlcBench
from tests.drivers.benches.remote_io_bench import RemoteIOBench
from tests.drivers.benches.robotiq_2f_bench import Robotiq2FBench
from tests.drivers.benches.scale_bench import MtSicsScaleBench
from tests.drivers.benches.screwdriver_bench import OpenProtocolScrewdriverBench
from tests.drivers.benches.two_axis_robot_bench import TwoAxisRobotBench
from tests.drivers.benches.universal_robots_bench import UR5eBench
from tests.drivers.benches.vacuum_gripper_bench import SuctionGripperBench

LOST = "device-1"
"""The kind of a lost connection, which is the same for all devices."""


class Fault(NamedTuple):
    """A fault and its alarm.

    command: of the control channel of the fake; empty for a fault that needs no device. kind: of the alarm,
    or several that are possible. action: fails because of the fault; without one, the device reports the fault by
    itself, and an action that waits for the device fails afterwards. before, trigger: actions that succeed before and
    after the fault.
    """

    command: str
    arguments: dict[str, Any]
    kind: str
    action: Callable[[Any], object] | None = None
    before: Callable[[Any], object] | None = None
    trigger: Callable[[Any], object] | None = None

    def __str__(self) -> str:
        """Return a name for the test."""
        return "-".join((self.command or "action", *map(str, self.arguments.values()), self.kind))


class ImpatientScaleBench(MtSicsScaleBench):
    """The scale, which waits 0.5 s for a stable load instead of 10 s."""

    def build(self, address: str) -> MtSicsScale:
        settings = MtSicsScaleSettings(address, answer_timeout=0.8, stable_timeout=0.5)
        return MtSicsScale("scale_id", "scale", settings=settings)


class ImpatientPrinterBench(ZplPrinterBench):
    """The label printer, which prints within 0.2 s and waits 1 s for a label instead of 15 s."""

    options: ClassVar[tuple[str, ...]] = ("--tcp", "127.0.0.1:0", "--duration", "0.2")

    def build(self, address: str) -> ZplPrinter:
        return ZplPrinter("printer_id", "printer", ZplPrinterSettings(address, answer_timeout=0.8, print_timeout=1.0))


class TalkingPrinterBench(ImpatientPrinterBench):
    """A label printer that also answers while it is out of labels or its head is open."""

    options = (*ImpatientPrinterBench.options, "--no-mute")


class ImpatientErpBench(ErpServiceBench):
    """The planning service. An alarm is raised when a result waits for 0.5 s instead of a minute."""

    def build(self, address: str) -> ErpService:
        settings = ErpSettings(
            address, outbox=self.folder.name, request_timeout=1.0, longest_pause=0.5, poll=0.1, waiting_alarm=0.5
        )
        return ErpService("erp_id", "planning", settings)


def _turn(bench: type[Any], by: float = 0.1) -> Callable[[Generic], object]:
    """Return a motion of a robot by an angle, rad."""
    return lambda robot: bench().turn(robot, by)


def _take_control(device: Generic) -> None:
    device.take_control()


def _release_control(device: Generic) -> None:
    device.release_control()


def _await_owner(device: Any) -> None:
    wait_until(lambda: device.control_owner() is not None, 5.0, "another client")


def _start_test(tester: FunctionalTester) -> None:
    tester.reset()
    tester.command(MachineCommand.START)
    tester.wait_for(MachineState.EXECUTE, 5.0)


def _grip(gripper: Robotiq2F) -> None:
    gripper.activate()
    gripper.grip(0.0)


def _report(service: ErpService) -> None:
    service.report_result("A-1", "S-1", True)


def _empty_bin(crate: Bin) -> None:
    crate.next_part(PictureNote.of(picture()).put_on(Image.fromarray(np.full((480, 640), 500, np.uint16))))


FAULTS: dict[type[Bench], list[Fault]] = {
    YuMiBench: [
        Fault("collide", {"arm": "left"}, "device-20"),
        Fault("control_state", {"state": "guardstop"}, "device-21"),
        Fault("control_state", {"state": "emergencystop"}, "device-22"),
        Fault("control_state", {"state": "sysfail"}, "device-26"),
        Fault("control_state", {"state": "motoroff"}, "device-3", _turn(YuMiBench)),
        Fault("foreign_program", {}, LOST, _turn(YuMiBench)),
        Fault("mastership_held", {}, "device-3", _take_control, _release_control),
        Fault("operation_mode", {"mode": "MANR"}, "device-21", _turn(YuMiBench)),
        Fault("rapid_error", {}, "device-6", _turn(YuMiBench)),
        Fault(
            "part",
            {"arm": "left", "on": False},
            "abb_yumi-1",
            lambda robot: robot.grip(ArmId.LEFT),
            lambda robot: robot.calibrate_gripper(ArmId.LEFT),
        ),
    ],
    BarcodeReaderBench: [
        Fault("health", {"value": "DIRTY"}, "barcode_reader-1"),
        Fault("health", {"value": "HOT"}, "barcode_reader-2"),
        Fault("health", {"value": "FAIL"}, "barcode_reader-3"),
        Fault("present", {"code": None}, "barcode_reader-4", lambda reader: reader.scan(0.5)),
        Fault("late", {"seconds": 1.0}, "barcode_reader-4", lambda reader: reader.scan(0.5)),
    ],
    BinBench: [
        Fault("", {}, "bin_picking-1", _empty_bin),
    ],
    BlisterBench: [
        Fault("", {}, "bin_picking-1", lambda tray: tray.next_part(), lambda tray: tray.clear()),
        Fault("", {}, "bin_picking-2", lambda tray: tray.next_free(), lambda tray: tray.refill()),
    ],
    ConveyorBench: [
        Fault("emergency", {"code": 0x8130}, "conveyor-1"),
        Fault("emergency", {"code": 0x2310}, "conveyor-2"),
        Fault("follow_error", {}, "conveyor-2", lambda belt: belt.move_by(1.0)),
        Fault("homing_fails", {}, "device-6", lambda belt: belt.home()),
        Fault("handshake_stuck", {}, "device-5", lambda belt: belt.move_by(0.1)),
        Fault("mute", {}, LOST),
    ],
    DobotMagicianBench: [
        Fault("alarm", {"code": 0x22}, "dobot_magician-1"),
        Fault("mute", {"number": 62}, LOST, lambda arm: arm.suck(True)),
        Fault("drive", {"turn": 90.0}, "device-3", _take_control, _release_control, _await_owner),
    ],
    ImpatientErpBench: [
        Fault("fail", {"status": 503, "count": -1, "path": "/results"}, "erp-1", trigger=_report),
        Fault("forbid", {"order": "A-1"}, "erp-2", trigger=_report),
        Fault("fail", {"status": 401, "count": -1, "path": "/results"}, "erp-3", trigger=_report),
        Fault("mistake", {"count": -1}, "erp-2", trigger=_report),
    ],
    FunctionalTesterBench: [
        *(Fault("fault", {"code": code}, f"functional_tester-{code - 100}") for code in range(101, 107)),
        Fault("emergency_stop", {"pressed": True}, "functional_tester-6"),
        Fault("take_board", {}, "device-7", lambda tester: tester.test(), lambda tester: tester.open_door()),
        Fault("mode", {"mode": "maintenance"}, "device-3", lambda tester: tester.test()),
        Fault("push_door", {"opening": True}, "functional_tester-2", before=_start_test),
    ],
    TalkingPrinterBench: [
        Fault("media", {"labels": 0}, "label_printer-1"),
        Fault("head_open", {}, "label_printer-2"),
    ],
    ImpatientPrinterBench: [
        Fault("media", {"labels": 0}, "label_printer-8"),
        Fault("ribbon_out", {}, "label_printer-3"),
        Fault("pause", {"on": True}, "label_printer-4"),
        Fault("hot", {}, "label_printer-5"),
        Fault("forgetful", {}, "label_printer-9", lambda printer: printer.print_label("title", "text", "1")),
    ],
    OakDBench: [
        Fault("overheat", {}, "oak_d-1"),
        Fault("frozen", {}, "oak_d-2"),
        Fault("depth_off", {}, "device-10", lambda camera: camera.depth_image()),
        Fault("overexposed", {}, "device-11", lambda camera: camera.color_image()),
        Fault("lens_covered", {}, "device-6", lambda camera: camera.color_image()),
    ],
    OpcUaPlcBench: [
        Fault("live", {"on": False}, "opcua_plc-1"),
        Fault("quality", {"name": "Level", "status": "BadSensorFailure"}, "opcua_plc-2"),
        Fault("job_error", {"code": 17}, "device-6", lambda plc: plc.run_job(1)),
        Fault("deaf", {}, "device-5", lambda plc: plc.run_job(1)),
        Fault("stuck", {}, "device-5", lambda plc: plc.run_job(1, 1.5)),
        Fault("stranger", {"number": 77}, "device-3", lambda plc: plc.run_job(1)),
        Fault("restart", {}, "device-3", lambda plc: plc.run_job(1)),
        Fault("remove", {"name": "Level"}, "device-6", lambda plc: plc.read_analog("level")),  # last: it stays
    ],
    RemoteIOBench: [
        Fault("diagnosis", {"supply_missing": True}, "remote_io-1"),
        Fault("diagnosis", {"overload": True}, "remote_io-2"),
        Fault("set_analog", {"number": 0, "raw": -32768}, "remote_io-3", lambda block: block.read_analog("level")),
        Fault("watchdogs_start", {"on": False}, "remote_io-4", _take_control, _release_control),
    ],
    Robotiq2FBench: [
        Fault("fault", {"code": 14}, "robotiq_2f-1"),
        Fault("fault", {"code": 5}, "robotiq_2f-1"),
        Fault("block", {}, "device-6", lambda gripper: gripper.release(), _grip),
    ],
    ImpatientScaleBench: [
        Fault("put", {"kg": 9.0}, "scale-1"),
        Fault("put", {"kg": -1.0}, "scale-2"),
        Fault("power_cycle", {}, "scale-3", lambda scale: scale.weight(), lambda scale: scale.tare()),
        Fault("error", {"code": "EL"}, "device-6", lambda scale: scale.weight()),
        Fault("busy", {}, "device-5", lambda scale: scale.weight()),
        Fault("vibrate", {}, "device-5", lambda scale: scale.weight()),
        Fault("unit", {"value": "lb"}, "device-6", lambda scale: scale.weight()),
    ],
    OpenProtocolScrewdriverBench: [
        Fault("alarm", {}, "screwdriver-1"),
        Fault("disable_commands", {}, "device-3", lambda screwdriver: screwdriver.tighten()),
    ],
    SuctionGripperBench: [
        Fault("set_input", {"number": 0, "on": False}, "vacuum_gripper-1", lambda gripper: gripper.grip()),
        Fault("set_input", {"number": 0, "on": True}, "vacuum_gripper-3", lambda gripper: gripper.release()),
    ],
    TwoAxisRobotBench: [
        Fault("hardware_error", {"servo": 1}, "two_axis_robot-1"),
        Fault("temperature", {"servo": 1, "celsius": 85}, "two_axis_robot-1"),
        Fault("status_error", {"servo": 1, "error": 6}, "device-7", _take_control, _release_control),
        Fault("absent", {"servo": 1}, LOST),
    ],
    UR5eBench: [
        Fault("protective_stop", {}, "device-20"),
        Fault("safeguard_stop", {}, "device-21"),
        Fault("emergency_stop", {}, "device-22"),
        Fault("recovery", {}, "device-24"),
        Fault("violation", {}, "device-25"),
        Fault("fault", {}, "device-26"),
        Fault("remote_control", {"on": False}, "device-3", _take_control, _release_control),
        # Without an answer, the driver cannot always distinguish another program from a computer that is too slow. If
        # the other program moves the arm while the motion is planned, the motion is not sent.
        Fault("foreign_program", {}, "device-5 device-4 device-7", _turn(UR5eBench)),
        Fault("power", {"on": False}, "device-3", _turn(UR5eBench)),
        Fault("boot", {}, "device-3", _turn(UR5eBench)),
        Fault("obstacle", {"point": [0.0, 0.0, 2.0], "normal": [0.0, 0.0, 1.0]}, "device-20", _turn(UR5eBench)),
        Fault("in_use", {"names": ["input_int_register_0"]}, "device-3", _take_control, _release_control),
        Fault("fieldbus", {}, "device-3", _take_control, _release_control),
    ],
}

FAKES: dict[type[Bench], str] = {YuMiBench: "abb_yumi", SuctionGripperBench: "remote_io", UR5eBench: "ur"}


def fake_of(bench: type[Bench]) -> str:
    """Return the name of the fake of a bench, empty if it needs none."""
    return FAKES.get(bench) or str(getattr(bench, "module", ""))


CONNECTION = {
    "silence",
    "reset",
    "half_frame",
    "garbage",
    "slow",
    "refuse",
    "wrong_checksum",
    "plug",
    "unplug",
    "power_cycle",
    "heal",
}
"""Faults of the wire, which are the same for all drivers. `test_lost_connection_is_exactly_one_alarm` injects the
silence; the others either are the same loss or are handled by repeating the request."""
READ = "It only returns what the fake has done."
RENEW = "It restores the delivered state."
WORLD = "It changes the simulated world, which is no fault."
PACE = "It changes the speed of the simulation."
ENDS = "It ends a fault."
RETRIED = "The driver repeats the request, so nothing has failed."
ALLOWED = "The device works as before, in a way that a person may choose."
NO_ALARM: dict[str, dict[str, str]] = {
    "abb_yumi": {"place": WORLD, "renew": RENEW, "speed_ratio": ALLOWED, "stops": READ},
    "barcode_reader": {"renew": RENEW},
    "conveyor": {"cause_gone": ENDS, "motion": READ},
    "dobot_magician": {"pace": PACE, "renew": RENEW, "stops": READ},
    "erp": {"add_order": WORLD, "forget": RENEW, "lose_answers": RETRIED, "received": READ, "work": ENDS},
    "functional_tester": {
        "command": "Another master commands the tester, as it may.",
        "put_board": WORLD,
        "renew": RENEW,
    },
    "label_printer": {"mute": "It selects whether a printer without labels answers.", "renew": RENEW},
    "oak_d": dict.fromkeys(("camera", "move", "place", "remove", "scene"), WORLD),
    "opcua_plc": {"set": WORLD},
    "remote_io": {"outputs": READ, "renew": RENEW, "set_inputs": WORLD},
    "robotiq_2f": {"pace": PACE, "put_part": WORLD, "remove_part": WORLD, "stops": READ},
    "scale": {"press": "A person tares the scale, as it may.", "renew": RENEW},
    "screwdriver": {
        "clear_alarm": ENDS,
        "lose_acknowledgements": RETRIED,
        "plan": WORLD,
        "pull": "A person tightens a screw, as in normal operation.",
        "renew": RENEW,
        "service": WORLD,
        "tighten": WORLD,
        "tool_data_revision": "It simulates an older controller, whose counters the driver does not read.",
    },
    "two_axis_robot": {"motion": READ, "place": WORLD, "sync_writes": READ, "wrong_crc": RETRIED},
    "ur": {
        "brake_release": ENDS,
        "calibration": WORLD,
        "commands_taken": READ,
        "contact": "It sets the flag that a motion until contact waits for. A collision is `obstacle`.",
        "guide": "A person moves the arm in hand teaching mode.",
        "no_obstacle": ENDS,
        "not_found": "It simulates an older controller; the driver refuses to connect.",
        "operational_mode": ALLOWED,
        "place": WORLD,
        "popup": READ,
        "pose": READ,
        "reduced": ALLOWED,
        "restart_safety": ENDS,
        "set_input": WORLD,
        "speed_slider": "A person slows the arm down. At 0 a motion fails with device-5 after 20 times its duration.",
        "stops": READ,
    },
}
"""Why other commands of fakes give no alarm."""
