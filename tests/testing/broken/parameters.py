"""A parameter that the device does not have is restored without a report."""

from arcor2_hw.data.maintenance import DeviceParameter, ParameterFailure

from .toy_press import ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def parameters_dump(self) -> list[DeviceParameter]:
        return [DeviceParameter("pressure", 6)]

    def parameters_restore(self, parameters: list[DeviceParameter]) -> list[ParameterFailure]:
        return []
