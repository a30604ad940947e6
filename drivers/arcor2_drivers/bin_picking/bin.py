"""Bin: a crate of parts whose next part is found in a depth image."""

import datetime
from typing import TYPE_CHECKING, ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import InvalidData, NotConnected, OutOfRange, Stale
from arcor2_hw.objects import GenericWithPose
from arcor2_hw.objects.connected import Connected
from arcor2_hw.objects.frame import PictureNote

from .poses import grip_pose
from .settings import BinSettings

if TYPE_CHECKING:
    from PIL import Image

    from .finder import EmptyCrate, View
    from .models import Model


class Bin(Connected, GenericWithPose):
    """A crate with parts of one kind. Its pose is at the centre of its inner floor, z up.

    It has no camera: a program passes the depth image of a camera, which includes how the image was taken.
    """

    _ABSTRACT = False
    display_name = "Bin"
    category = "Containers"
    icon = "bin"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()  # there is no device

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: BinSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._config = settings
        self._model: Model | None = None
        self.keep_connection(name)

    # -------------------------------------------------------------------------------- connection
    def open_link(self, timeout: float) -> None:
        """Load the model of the part. Raises NotConnected if the model is invalid or Open3D is not installed."""
        try:
            from . import models
        except ImportError as error:
            raise NotConnected(
                "{name}: Open3D or OpenCV is not installed. Install the extra `vision`: arcor2-hw[vision].",
                str(error),
                name=self.name,
            ) from error
        try:
            self._model = models.load(self._config)
        except models.BadModel as error:
            raise NotConnected("{name}: {reason}", self._config.part_mesh, name=self.name, reason=error) from error

    def close_link(self) -> None:
        """Forget the model."""
        self._model = None

    def _loaded(self) -> "Model":
        if self._model is None:
            raise NotConnected("{name} is not connected", name=self.name)
        return self._model

    def stop(self) -> None:
        """Cancel a search for a part that is running."""
        self.stop_waiting()

    # -------------------------------------------------------------------------------- actions
    @action
    def next_part(self, depth: "Image.Image", *, an: str | None = None) -> tuple[Pose, float]:
        """Return the pose of the part to pick next, and its quality, 0 to 1.

        :param depth: depth image of the crate, from the action depth_image of a camera
        """
        from .finder import find

        model = self._loaded()
        view = self._view(depth)
        go_on = self.begin("the search for a part")
        found = find(view, self._crate(), model, self._config.tolerance, self._config.min_quality, go_on)
        return self.pose * Pose.from_matrix(found.pose), round(found.fit.quality, 4)

    @action
    def is_empty(self, depth: "Image.Image", *, an: str | None = None) -> bool:
        """Return whether the crate is empty.

        :param depth: depth image of the crate, from the action depth_image of a camera
        """
        from .finder import has_parts

        model = self._loaded()
        return not has_parts(self._view(depth), self._crate(), model, self._config.tolerance)

    @action
    def grip_pose(self, part: Pose, above: float = 0.0, *, an: str | None = None) -> Pose:
        """Return the pose of the tool for gripping a part: z points down into its top, x along its length.

        :param part: pose from next_part
        :param above: distance above the grip pose, for approach and departure, m
        """
        assert 0.0 <= above <= 2.0

        model = self._loaded()
        up = self.pose.orientation.matrix()[:, 2]
        rotated = model.vertices @ part.orientation.matrix().T
        middle = Pose(part.position, part.orientation)
        offset = part.orientation.matrix() @ ((model.low + model.high) / 2.0)
        offset -= (offset @ up) * up
        for axis, value in zip("xyz", offset, strict=True):
            setattr(middle.position, axis, getattr(part.position, axis) + float(value))
        return grip_pose(middle, self.pose, float((rotated @ up).max()) - self._config.grip_depth, above)

    # -------------------------------------------------------------------------------- image
    def _crate(self) -> "EmptyCrate":
        from .finder import EmptyCrate

        return EmptyCrate(self.name, self._config.length, self._config.width, self._config.height)

    def _view(self, image: "Image.Image") -> "View":
        import numpy as np

        from .finder import View

        try:
            note = PictureNote.of(image)
        except InvalidData as error:
            raise InvalidData("{name}: {reason}", name=self.name, reason=error) from error
        age = (datetime.datetime.now(datetime.UTC) - datetime.datetime.fromisoformat(note.stamp)).total_seconds()
        if age > self._config.max_age:
            raise Stale(
                "{name}: the image of {camera} is {age:.1f} s old, at most {max_age:g} s are allowed",
                name=self.name,
                camera=note.camera,
                age=age,
                max_age=self._config.max_age,
            )
        depth = np.asarray(image)
        if depth.ndim != 2 or depth.dtype != np.uint16:
            raise OutOfRange(
                "{name}: depth must be an image with 16 bits per pixel, mm, not of mode {mode}",
                name=self.name,
                mode=image.mode,
            )
        return View(depth, note.parameters, (self.pose.inverted() * note.pose).matrix())
