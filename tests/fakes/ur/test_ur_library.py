"""The fake controller with ur_rtde. Each case runs the library in a separate process."""

import itertools
import math
import time

import pytest

from arcor2_fakes.ur.kinematics import difference, from_pose

HOME = (0.0, -math.pi / 2, math.pi / 2, -math.pi / 2, -math.pi / 2, 0.0)


def test_receiving_at_500_hz_misses_no_sample(ur):
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "actual_q", "actual_TCP_pose", "robot_mode", "safety_mode"])
samples, single = [(time.monotonic(), receive.getTimestamp())], 0
while samples[-1][1] < samples[0][1] + 2.0 or single <= 100:  # a busy machine delays this loop
    t = receive.getTimestamp()
    if t != samples[-1][1]:
        single += t - samples[-1][1] < 0.003
        samples.append((time.monotonic(), t))
    time.sleep(0.0003)
report(samples=samples, q=receive.getActualQ(), pose=receive.getActualTCPPose(), mode=receive.getRobotMode())
""")
    clocks, stamps = zip(*seen["samples"], strict=True)
    ticks = [round(t * 500) for t in stamps]
    assert [t * 500 for t in stamps] == pytest.approx(ticks, abs=1e-6)
    # The fake catches up 0.2 s at most.
    assert stamps[-1] - stamps[0] < clocks[-1] - clocks[0] + 0.25
    stretches = itertools.pairwise(range(0, len(ticks), 50))
    assert max((ticks[j] - ticks[i]) / (clocks[j] - clocks[i]) for i, j in stretches) > 450
    assert min(b - a for a, b in itertools.pairwise(ticks)) > 0
    assert seen["q"] == pytest.approx(HOME)
    assert seen["mode"] == 7
    assert ur.do("truth")["samples_lost"] == 0


def test_the_default_recipe_is_served_completely(start_ur):
    ur = start_ur("--controller-version", "5.12")
    seen = ur.library("""
receive = Receive(host)
report(joint_mode=receive.getJointMode(), safety=receive.getSafetyStatusBits(), robot=receive.getRobotStatus(),
       accelerometer=receive.getActualToolAccelerometer(), scaling=receive.getSpeedScaling())
""")
    assert seen["joint_mode"] == [253] * 6
    assert seen["safety"] == 1
    assert seen["robot"] & 1


def test_move_j_arrives_within_its_limits(ur):
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "actual_q", "actual_qd"])
control = Control(host, 500.0)
goal = [0.6, -1.2, 1.3, -1.7, -1.4, 0.3]
begin = time.monotonic()
control.moveJ(goal, 0.8, 2.0, True)
fastest, statuses = 0.0, []
until(lambda: fake.do("truth")["moving"])
while control.getAsyncOperationProgressEx().isAsyncOperationRunning():
    fastest = max(fastest, *map(abs, receive.getActualQd()))
    time.sleep(0.001)
took = time.monotonic() - begin
until(lambda: not any(receive.getActualQd()))
report(took=took, fastest=fastest, q=receive.getActualQ(), goal=goal, qd=receive.getActualQd(),
       back=control.moveJ(HOME, 3.0, 20.0), home=fake.do("truth")["q"])
""")
    assert seen["q"] == pytest.approx(seen["goal"], abs=1e-9)
    assert seen["qd"] == [0.0] * 6
    assert seen["fastest"] == pytest.approx(0.8, rel=0.01)
    assert seen["took"] > 1.05  # 0.6 / 0.8 + 0.8 / 2.0 s
    assert seen["back"]
    assert seen["home"] == pytest.approx(HOME, abs=1e-9)


def test_asynchronous_move_is_stopped(ur):
    seen = ur.library("""
control = Control(host, 500.0)
control.moveJ([2.0] + HOME[1:], 1.0, 2.0, True)
until(lambda: fake.do("truth")["q"][0] > 0.3)
sent = time.monotonic()
control.stopJ(3.0, True)
until(lambda: not fake.do("truth")["moving"])
q = fake.do("truth")["q"]
time.sleep(0.3)
report(sent=sent, q=q, later=fake.do("truth")["q"],
       running=control.getAsyncOperationProgressEx().isAsyncOperationRunning())
""")
    assert 0.3 < seen["q"][0] < 1.5
    assert seen["later"] == seen["q"]
    assert not seen["running"]
    (stop,) = ur.do("stops")
    assert (stop["via"], stop["code"]) == ("rtde", 34)
    assert stop["t"] >= seen["sent"]
    assert ur.do("commands_taken")[-1]["kind"] == "stopl"  # the function that the library's program really calls


def test_move_l_is_a_straight_line(ur):
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "actual_TCP_pose", "actual_TCP_speed"])
control = Control(host, 500.0)
start = receive.getActualTCPPose()
goal = [start[0] + 0.05, start[1] - 0.1, start[2] - 0.1] + start[3:]
control.moveL(goal, 0.2, 1.0, True)
path = []
until(lambda: fake.do("truth")["moving"])
while fake.do("truth")["moving"]:
    path.append(receive.getActualTCPPose()[:3] + [sum(v * v for v in receive.getActualTCPSpeed()[:3]) ** 0.5])
until(lambda: not any(receive.getActualTCPSpeed()))
report(start=start, goal=goal, path=path, end=receive.getActualTCPPose())
""")
    shift, turn = difference(from_pose(seen["end"]), from_pose(seen["goal"]))  # a half turn has two rotation vectors
    assert max(map(abs, (*shift, *turn))) < 1e-6
    line = [g - s for g, s in zip(seen["goal"][:3], seen["start"][:3], strict=True)]
    assert len(seen["path"]) > 20
    for *point, _ in seen["path"]:
        along = [p - s for p, s in zip(point, seen["start"][:3], strict=True)]
        f = sum(a * b for a, b in zip(along, line, strict=True)) / sum(b * b for b in line)
        assert math.dist(along, [f * b for b in line]) < 1e-6
    assert max(speed for *_, speed in seen["path"]) == pytest.approx(0.2, rel=0.01)


def test_kinematics_tcp_and_payload_over_the_wire(ur):
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "actual_q", "actual_TCP_pose", "payload", "payload_cog"])
control = Control(host, 500.0)
q = [0.3, -1.3, 1.4, -1.6, -1.5, 0.2]
control.setTcp([0.0, 0.0, 0.15, 0.0, 0.0, 0.0])
flange = control.getForwardKinematics(q, [0.0] * 6)
tip = control.getForwardKinematics(q, control.getTCPOffset())
near = control.getInverseKinematics(tip, q)
control.moveJ_IK(tip, 3.0, 20.0)
reached = fake.do("truth")["tcp_pose"]
control.moveL_FK(HOME, 1.0, 10.0)
control.setPayload(1.5, [0.0, 0.0, 0.04])
until(lambda: receive.getPayload() == 1.5)
report(flange=flange, tip=tip, near=near, q=q, reached=reached, home=fake.do("truth")["q"],
       payload=receive.getPayload(), cog=receive.getPayloadCog(), offset=control.getTCPOffset(),
       inside=control.isPoseWithinSafetyLimits(tip), outside=control.isPoseWithinSafetyLimits([3.0, 0, 0, 0, 0, 0]))
""")
    assert math.dist(seen["flange"][:3], seen["tip"][:3]) == pytest.approx(0.15)
    assert seen["near"] == pytest.approx(seen["q"], abs=1e-6)
    assert seen["reached"] == pytest.approx(seen["tip"], abs=1e-6)
    assert seen["home"] == pytest.approx(HOME, abs=1e-6)
    assert seen["payload"] == 1.5
    assert seen["cog"] == [0.0, 0.0, 0.04]
    assert seen["offset"] == [0.0, 0.0, 0.15, 0.0, 0.0, 0.0]
    assert seen["inside"]
    assert not seen["outside"]


def test_speed_and_servo(ur):
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "actual_q", "actual_qd", "actual_TCP_speed"])
control = Control(host, 500.0)
control.speedJ([0.4, 0, 0, 0, 0, 0], 2.0)
until(lambda: receive.getActualQd()[0] > 0.399999)
joint_speed = receive.getActualQd()
control.speedStop(5.0)
until(lambda: not any(receive.getActualQd()))
stopped = receive.getActualQd()
control.speedL([0.0, 0.0, -0.1, 0, 0, 0], 1.0)
until(lambda: receive.getActualTCPSpeed()[2] < -0.09999)
linear_speed = receive.getActualTCPSpeed()
control.speedStop(5.0)
target = receive.getActualQ()
for i in range(200):
    target[5] += 0.001
    t = control.initPeriod()
    control.servoJ(target, 0.0, 0.0, 0.002, 0.1, 300)
    control.waitPeriod(t)
until(lambda: abs(receive.getActualQ()[5] - target[5]) < 1e-4)
followed = receive.getActualQ()
control.servoStop()
report(joint_speed=joint_speed, stopped=stopped, linear_speed=linear_speed, target=target, followed=followed)
""")
    assert seen["joint_speed"] == pytest.approx([0.4, 0, 0, 0, 0, 0], abs=1e-6)
    assert seen["stopped"] == [0.0] * 6
    assert seen["linear_speed"] == pytest.approx([0, 0, -0.1, 0, 0, 0], abs=1e-4)
    assert seen["followed"] == pytest.approx(seen["target"], abs=1e-3)


def test_path_custom_script_and_stop_script(ur):
    seen = ur.library("""
control = Control(host, 500.0)
a, b = [0.2] + HOME[1:], [0.4] + HOME[1:]
path = control.moveJ([a + [2.0, 8.0, 0.0], b + [2.0, 8.0, 0.0]])
at = fake.do("truth")["q"]
custom = control.sendCustomScriptFunction("gripper", "set_tool_digital_out(0, True)\\nsleep(0.05)\\n")
until(lambda: control.isProgramRunning())
time.sleep(0.05)
again = control.moveJ(HOME, 3.0, 20.0)
control.stopScript()
until(lambda: fake.do("truth")["runtime"] == "STOPPED")
report(path=path, at=at, b=b, custom=custom, again=again, outputs=fake.do("truth")["digital_outputs"])
""")
    assert seen["path"]
    assert seen["custom"]
    assert seen["again"]
    assert seen["at"] == pytest.approx(seen["b"], abs=1e-5)  # the library writes six digits into the program
    assert seen["outputs"] == 1 << 16


def test_digital_outputs_inputs_and_speed_slider(ur):
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "actual_digital_output_bits", "actual_digital_input_bits",
                                "target_speed_fraction"])
io = IO(host)
io.setStandardDigitalOut(3, True)
io.setConfigurableDigitalOut(1, True)
io.setToolDigitalOut(0, True)
io.setSpeedSlider(0.25)
until(lambda: receive.getActualDigitalOutputBits() == 1 << 3 | 1 << 9 | 1 << 16)
io.setStandardDigitalOut(3, False)
until(lambda: receive.getActualDigitalOutputBits() == 1 << 9 | 1 << 16)
fake.do("set_input", bit=5)
until(lambda: receive.getDigitalInState(5))
until(lambda: receive.getTargetSpeedFraction() == 0.25)
report(inputs=receive.getActualDigitalInputBits())
""")
    assert seen["inputs"] == 1 << 5
    truth = ur.do("truth")
    assert truth["digital_outputs"] == 1 << 9 | 1 << 16
    assert truth["speed_slider"] == 0.25


def test_watchdog_stops_the_arm_when_kicks_cease(ur):
    seen = ur.library("""
control = Control(host, 500.0)
control.setWatchdog(2.0)
control.moveJ([3.0] + HOME[1:], 0.8, 5.0, True)
for _ in range(20):
    control.kickWatchdog()
    time.sleep(0.03)
kicked = fake.do("truth")
until(lambda: not fake.do("truth")["moving"])
report(kicked=kicked["moving"], trips_before=kicked["watchdog_trips"])
""")
    assert seen["kicked"]
    assert seen["trips_before"] == 0
    truth = ur.do("truth")
    assert truth["watchdog_trips"] == 1
    assert truth["program"] is None
    assert truth["q"][0] < 2.5


def test_a_killed_client_leaves_the_arm_at_standstill(ur):
    """After kill -9 during a move, no more commands are sent, and the watchdog stops the arm."""
    with pytest.raises(AssertionError, match="status -9"):
        ur.library("""
control = Control(host, 500.0)
control.setWatchdog(10.0)
control.moveJ([3.0] + HOME[1:], 1.0, 5.0, True)
for _ in range(10):
    control.kickWatchdog()
    time.sleep(0.03)
os.kill(os.getpid(), 9)
""")
    ur.control.wait_until(lambda t: not t["moving"])
    assert ur.do("truth")["watchdog_trips"] == 1


@pytest.mark.parametrize("fault", ["silence", "half_frame", "reset"])
def test_a_cable_cut_during_a_move_ends_at_standstill(ur, fault):
    """The library keeps kicking, reconnects by itself and sometimes crashes: none of this may move the arm."""
    with ur.library_running("""
control = Control(host, 500.0)
control.setWatchdog(2.0)
control.moveJ([3.0] + HOME[1:], 0.8, 5.0, True)
while True:
    control.kickWatchdog()
    time.sleep(0.03)
"""):
        ur.control.wait_until(lambda t: t["q"][0] > 0.2)
        if fault == "reset":
            ur.do("refuse", wire="rtde")  # otherwise it may reconnect and kick again before the watchdog expires
        ur.do(fault, wire="rtde")
        resting = ur.control.wait_until(lambda t: not t["moving"])
        assert resting["q"][0] < 2.0
        ur.do("heal", wire="rtde")
        time.sleep(0.5)
        assert ur.do("truth")["q"] == resting["q"]


def test_a_protective_stop_is_reported_and_unlocked(ur):
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "safety_status_bits", "actual_q", "runtime_state"])
control, dashboard = Control(host, 500.0), Dashboard(host)
dashboard.connect()
control.moveJ([1.5] + HOME[1:], 1.0, 2.0, True)
until(lambda: fake.do("truth")["q"][0] > 0.2)
fake.do("protective_stop")
until(receive.isProtectiveStopped)
refused = control.moveJ(HOME)
try:
    dashboard.unlockProtectiveStop()
    early = None
except RuntimeError as e:
    early = str(e)
dashboard.stop()
def unlocked():
    try:
        dashboard.unlockProtectiveStop()
        return True
    except RuntimeError:
        return False
until(unlocked)  # after five seconds of the controller's clock
until(lambda: not receive.isProtectiveStopped())
resting = fake.do("truth")["q"]
time.sleep(0.3)
still = fake.do("truth")["q"]
control.reuploadScript()
until(control.isProgramRunning)
time.sleep(0.05)
report(refused=refused, early=early, resting=resting, still=still, again=control.moveJ(HOME, 3.0, 20.0))
""")
    assert seen["refused"] is False
    assert "until 5s after occurrence" in seen["early"]
    assert seen["still"] == seen["resting"]
    assert seen["again"]


def test_a_safeguard_stop_pauses_the_program(ur):
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "safety_mode", "runtime_state", "actual_q"])
control = Control(host, 500.0)
goal = [0.8] + HOME[1:]
control.moveJ(goal, 1.0, 2.0, True)
until(lambda: fake.do("truth")["q"][0] > 0.2)
fake.do("safeguard_stop", on=True)
until(lambda: receive.getSafetyMode() == 5 and not fake.do("truth")["moving"])
until(lambda: receive.getActualQ() == fake.do("truth")["q"])
mode, resting = receive.getSafetyMode(), receive.getActualQ()
time.sleep(0.3)
still = receive.getActualQ()
fake.do("safeguard_stop", on=False)
until(lambda: not fake.do("truth")["moving"] and fake.do("truth")["q"][0] > 0.7)
until(lambda: receive.getActualQ() == fake.do("truth")["q"])
report(mode=mode, resting=resting, still=still, goal=goal, end=receive.getActualQ())
""")
    assert seen["mode"] == 5
    assert seen["still"] == seen["resting"]
    assert seen["resting"][0] < 0.7
    assert seen["end"] == pytest.approx(seen["goal"], abs=1e-9)


def test_a_synchronous_move_survives_a_safeguard_stop_but_not_an_emergency_stop(ur):
    seen = ur.library("""
import threading
control = Control(host, 500.0)
ends = {}
def move(name, goal):
    ends[name] = control.moveJ([goal] + HOME[1:], 1.0, 4.0)
def start(name, goal):
    thread = threading.Thread(target=move, args=(name, goal), daemon=True)
    thread.start()
    until(lambda: fake.do("truth")["moving"])
    return thread
first = start("first", 0.5)
fake.do("safeguard_stop", on=True)
first.join(1.0)
waits = first.is_alive()
fake.do("safeguard_stop", on=False)
first.join(20.0)
second = start("second", 1.5)
fake.do("emergency_stop", on=True)
second.join(20.0)
until(lambda: fake.do("truth")["robot_mode"] == "POWER_OFF")
report(waits=waits, ends=ends, hangs=second.is_alive(), truth=fake.do("truth"))
""")
    assert seen["waits"]
    assert seen["ends"] == {"first": True, "second": False}
    assert not seen["hangs"]
    assert seen["truth"]["safety"] == "ROBOT_EMERGENCY_STOP"


def test_a_foreign_program_survives_observation_but_not_control(ur):
    ur.do("foreign_program", on=True)
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "actual_q", "runtime_state", "robot_status_bits"])
time.sleep(0.3)
runtime, observed = receive.getRuntimeState(), fake.do("truth")
control = Control(host, 500.0)
report(runtime=runtime, observed=observed, controlled=fake.do("truth"))
""")
    assert seen["runtime"] == 2
    assert seen["observed"]["program"] == "production.urp"
    assert seen["observed"]["moving"]
    assert seen["controlled"]["program"] == "rtde_control"


def test_local_control_ignores_scripts(ur):
    ur.do("remote_control", on=False)
    seen = ur.library("""
dashboard = Dashboard(host)
dashboard.connect()
try:
    Control(host, 500.0)
    error = None
except RuntimeError as e:
    error = str(e)
report(error=error, remote=dashboard.isInRemoteControl())
""")
    assert "remote control" in seen["error"]
    assert seen["remote"] is False
    truth = ur.do("truth")
    assert truth["program"] is None
    assert truth["scripts_taken"] == 0


@pytest.mark.parametrize("fault", ["silence", "half_frame", "reset"])
def test_a_lost_stream_is_detected_and_recovers(ur, fault):
    seen = ur.library(f"""
receive = Receive(host, 500.0, ["timestamp", "actual_q"])
fake.do("{fault}", wire="rtde")
def silent():
    global before
    before = receive.getTimestamp()
    time.sleep(0.3)
    return receive.getTimestamp() == before
until(silent)
stuck = receive.getTimestamp() - before
fake.do("heal", wire="rtde")
if stuck == 0.0:
    receive.disconnect()
    receive.reconnect()
until(lambda: receive.getTimestamp() > before + 0.1)
report(stuck=stuck)
""")
    assert seen["stuck"] == 0.0


def test_polyscope_x_has_no_dashboard(start_ur):
    ur = start_ur("--controller-version", "10.12")
    assert ur.ready["dashboard"] is None
    seen = ur.library("""
receive = Receive(host, 500.0, ["timestamp", "actual_q"])
dashboard = Dashboard(host)
try:
    dashboard.connect(500)
    error = None
except RuntimeError as e:
    error = str(e)
report(error=error, q=receive.getActualQ())
""")
    assert seen["error"]
    assert seen["q"] == pytest.approx(HOME)


def test_upper_registers_before_5_23(start_ur):
    """From 5.23 on the library mixes both halves with this flag: its program uses one, its recipes the other."""
    ur = start_ur("--controller-version", "5.22")
    seen = ur.library("""
control = Control(host, 500.0, Control.FLAG_UPLOAD_SCRIPT | Control.FLAG_UPPER_RANGE_REGISTERS)
done = control.moveJ([0.2] + HOME[1:], 2.0, 10.0)
control.setWatchdog(10.0)
report(done=done, truth=fake.do("truth"))
""")
    assert seen["done"]
    assert seen["truth"]["register_offset"] == 24
    assert seen["truth"]["q"][0] == pytest.approx(0.2)
    ur.control.wait_until(lambda t: t["watchdog_trips"] == 1)


@pytest.mark.parametrize("version", ["3.15", "5.4", "5.12", "10.12"])
def test_control_of_other_versions(start_ur, version):
    ur = start_ur("--controller-version", version, *(["--frequency", "125"] if version.startswith("3.") else []))
    seen = ur.library("""
control = Control(host)
moved = control.moveJ([0.2] + HOME[1:], 3.0, 20.0)
report(moved=moved, truth=fake.do("truth"))
""")
    assert seen["moved"]
    assert seen["truth"]["q"][0] == pytest.approx(0.2)


def test_hand_guiding_only_in_freedrive(ur):
    seen = ur.library("""
control = Control(host, 500.0)
goal = [0.3] + HOME[1:]
def guided():
    try:
        fake.do("guide", q=goal, speed=2.0)
        return True
    except Exception:
        return False
before = guided()
control.teachMode()
during = guided()
until(lambda: abs(fake.do("truth")["q"][0] - 0.3) < 1e-9)
control.endTeachMode()
report(before=before, during=during, after=guided())
""")
    assert (seen["before"], seen["during"], seen["after"]) == (False, True, False)
