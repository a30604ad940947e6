"""A crate of parts as an object type: the pose of the next part, from a depth picture."""

import datetime
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

from arcor2_hw.actions import action
from arcor2_hw.data.device import Connection, LossReaction
from arcor2_hw.data.geometry import Pose
from arcor2_hw.exceptions import Cancelled, DeviceError, InvalidData, NotConnected, OutOfRange, Stale
from arcor2_hw.objects import GenericWithPose
from arcor2_hw.objects.frame import PictureNote
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT

from .poses import gripping
from .settings import BinSettings

if TYPE_CHECKING:
    from PIL import Image

    from .finder import Crated, View
    from .models import Model


class Bin(GenericWithPose):
    """A crate with parts of one kind in it. Its pose is the middle of its floor inside, z upwards.

    It has no camera of its own: a program links a camera's depth picture to it, which says how it was taken.
    """

    _ABSTRACT = False
    category = "Containers"
    icon = "bin"
    loss_reaction: ClassVar[LossReaction] = LossReaction.holds()  # there is no device that could lose us

    def __init__(self, obj_id: str, name: str, pose: Pose, settings: BinSettings) -> None:
        super().__init__(obj_id, name, pose, settings)
        self._given = settings
        self._model: Model | None = None
        self._connected = Connection.OFFLINE
        self._stops = 0

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Load the model of the part. Raises NotConnected when it is none, or when Open3D is not installed."""
        if self._model is not None:
            return
        self._connected = Connection.FAILED
        try:
            from . import models
        except ImportError as error:
            raise NotConnected(
                "{name}: Open3D or OpenCV is not installed here; they come with the extra `vision` (arcor2-hw[vision])",
                str(error),
                name=self.name,
            ) from error
        try:
            self._model = models.load(self._given)
        except models.BadModel as error:
            raise NotConnected("{name}: {reason}", self._given.part_mesh, name=self.name, reason=error) from error
        self._connected = Connection.ONLINE

    def disconnect(self) -> None:
        """Forget the model."""
        self._model = None
        self._connected = Connection.OFFLINE

    @property
    def connection(self) -> Connection:
        """Return whether the model is loaded."""
        return self._connected

    def _loaded(self) -> "Model":
        if self._model is None:
            raise NotConnected("{name} is not connected", name=self.name)
        return self._model

    def stop(self) -> None:
        """End a search for a part, which then raises Cancelled; called while it runs."""
        self._stops += 1

    def _go_on(self) -> Callable[[], None]:
        """Return what raises Cancelled once a stop has come."""
        stops = self._stops

        def go_on() -> None:
            if self._stops != stops:
                raise Cancelled("{name}: the search for a part was stopped", name=self.name)

        return go_on

    # -------------------------------------------------------------------------------- actions
    @action
    def next_part(self, depth: "Image.Image", *, an: str | None = None) -> tuple[Pose, float]:
        """Return the pose of the part to be taken next, and its quality, 0 to 1.

        :param depth: depth picture of the crate, as a camera's depth_image gives
        """
        from .finder import find

        model = self._loaded()
        view = self._view(depth)
        try:
            found = find(view, self._crate(), model, self._given.tolerance, self._given.min_quality, self._go_on())
        except DeviceError as error:
            raise type(error)(f"{self.name}: {error}", error.detail) from error
        return self.pose * Pose.from_matrix(found.pose), round(found.fit.quality, 4)

    @action
    def is_empty(self, depth: "Image.Image", *, an: str | None = None) -> bool:
        """Return whether nothing lies in the crate.

        :param depth: depth picture of the crate, as a camera's depth_image gives
        """
        from .finder import lies_there

        model = self._loaded()
        try:
            return not lies_there(self._view(depth), self._crate(), model, self._given.tolerance)
        except DeviceError as error:
            raise type(error)(f"{self.name}: {error}", error.detail) from error

    @action
    def grip_pose(self, part: Pose, above: float = 0.0, *, an: str | None = None) -> Pose:
        """Return the pose for the tool at a part: z down into its top, x along its length.

        :param part: what next_part gave
        :param above: metres by which the tool is higher, for coming near and going away
        """
        assert 0.0 <= above <= 2.0

        model = self._loaded()
        up = self.pose.orientation.matrix()[:, 2]
        turned = model.vertices @ part.orientation.matrix().T
        middle = Pose(part.position, part.orientation)
        offset = part.orientation.matrix() @ ((model.low + model.high) / 2.0)
        offset -= (offset @ up) * up
        for axis, value in zip("xyz", offset, strict=True):
            setattr(middle.position, axis, getattr(part.position, axis) + float(value))
        return gripping(middle, self.pose, float((turned @ up).max()) - self._given.grip_depth, above)

    # -------------------------------------------------------------------------------- picture
    def _crate(self) -> "Crated":
        from .finder import Crated

        return Crated(self._given.length, self._given.width, self._given.height)

    def _view(self, picture: "Image.Image") -> "View":
        import numpy as np

        from .finder import View

        try:
            note = PictureNote.of(picture)
        except InvalidData as error:
            raise InvalidData("{name}: {reason}", name=self.name, reason=error) from error
        age = (datetime.datetime.now(datetime.UTC) - datetime.datetime.fromisoformat(note.stamp)).total_seconds()
        if age > self._given.max_age:
            raise Stale(
                "{name}: the picture of {camera} is {age:.1f} s old, {max_age:g} s at most are asked for",
                name=self.name,
                camera=note.camera,
                age=age,
                max_age=self._given.max_age,
            )
        depth = np.asarray(picture)
        if depth.ndim != 2 or depth.dtype != np.uint16:
            raise OutOfRange(
                "{name}: depth must be a picture of 16 bits, mm, not of mode {mode}", name=self.name, mode=picture.mode
            )
        return View(depth, note.parameters, (self.pose.inverted() * note.pose).matrix())
