"""Connect one robot as the cell host does; print received and missed samples and processor time after a while."""

import sys
import time

import msgspec

from arcor2_drivers.universal_robots.settings import UrSettings
from arcor2_drivers.universal_robots.ur5e import UR5e
from arcor2_hw.data.geometry import Pose

robot = UR5e("obj_bench", "robot", Pose(), UrSettings(sys.argv[1]))
robot.connect()
time.sleep(1.0)
received, missed = robot.samples_received, robot.samples_missed
cpu, begin = time.process_time(), time.monotonic()
time.sleep(float(sys.argv[2]))
result = {
    "received": robot.samples_received - received,
    "missed": robot.samples_missed - missed,
    "cpu": time.process_time() - cpu,
    "seconds": time.monotonic() - begin,
}
robot.disconnect()
sys.stdout.write(msgspec.json.encode(result).decode())
