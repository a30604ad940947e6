"""Backups of the settings of the scale, by commands of MT-SICS level 2."""

from arcor2_drivers.scale.mt_sics_scale import MtSicsScale
from arcor2_hw.data.maintenance import DeviceParameter
from tests.fakes.conftest import FakeProcess

ENVIRONMENT = "environment (M02)"


def test_settings_are_written_and_failures_are_named(scale: MtSicsScale, fake: FakeProcess) -> None:
    before = scale.parameters_dump()
    assert [(each.name, each.value) for each in before] == [
        ("weighing mode (M01)", 0),
        (ENVIRONMENT, 2),
        ("automatic zero (M03)", 1),
        ("zeroing at restart (M35)", 0),
    ]
    wanted = [
        DeviceParameter(ENVIRONMENT, 1),
        DeviceParameter("automatic zero (M03)", 7),
        DeviceParameter("weighing mode (M01)", "fast"),
        DeviceParameter("mode after restart (M31)", 1),  # this model does not have this setting
    ]
    failures = {each.name: each.reason for each in scale.parameters_restore(wanted)}
    assert failures == {
        "automatic zero (M03)": "The scale did not accept 7 and keeps 1.",
        "weighing mode (M01)": "fast cannot be sent to the scale.",
        "mode after restart (M31)": "The scale has no setting mode after restart (M31).",
    }
    assert DeviceParameter(ENVIRONMENT, 1) in scale.parameters_dump()
    fake.control.do("power_cycle")
    assert DeviceParameter(ENVIRONMENT, 1) in scale.parameters_dump()
