"""Connect one camera as the cell host does; print frames, their age and processor time after a while."""

import sys
import time

import msgspec

from arcor2_drivers.oak_d.oak_d import OakD
from arcor2_drivers.oak_d.settings import OakDSettings
from arcor2_hw.data.geometry import Pose
from benchmarks.metrics import median

camera = OakD("obj_bench", "camera", Pose(), None, OakDSettings(sys.argv[1]))
camera.connect(20.0)
time.sleep(1.0)
seconds = float(sys.argv[2])
before, cpu, begin = camera.images_received, time.process_time(), time.monotonic()
time.sleep(seconds)
cpu, frames, seconds = time.process_time() - cpu, camera.images_received - before, time.monotonic() - begin
ages = []
for _ in range(20):
    ages.append(camera.latency)
    time.sleep(0.037)
camera.disconnect()
result = {"frames": frames, "cpu": cpu, "seconds": seconds, "age": median(ages)}
sys.stdout.write(msgspec.json.encode(result).decode())
