"""Creates the message that opens a scene in a cell host."""

from collections.abc import Callable
from dataclasses import dataclass

from arcor2_hw.data.base import Unset
from arcor2_hw.data.device import Identity
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.scene import Scene
from arcor2_hw.runtime import messages as m
from arcor2_server.documents import Session
from arcor2_server.hosts.devices import overlay_for
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.settings import ServerSettings
from arcor2_server.storage.setting_secrets import SettingSecrets
from arcor2_server.workspace.host_world import HostWorld


@dataclass(frozen=True, slots=True)
class SceneOpening:
    """Creates the message with settings, secrets, object types and collision models."""

    _settings: ServerSettings
    _types: ObjectTypes
    _session: Session
    _secrets: SettingSecrets
    _host_world: HostWorld
    _identities: Callable[[], dict[str, Identity]]

    async def prepare(self, scene: Scene, keep_going: bool) -> tuple[m.OpenScene, dict[str, list[str]]]:
        """Return the message without the workspace, and the names of overridden settings by id of the object.

        Args:
            scene: the scene.
            keep_going: leave out objects that cannot be created or connected.

        Raises:
            NotFound: a type or a secret is missing.
            InvalidData: an object has another type in the cell file.
            StorageError: secrets cannot be stored.
        """
        here, overlaid = overlay_for(self._settings.cell, self._secrets.is_secret, scene)
        names = {obj.type for obj in scene.objects}
        models: dict[str, ObjectModel] = {}
        for name in names:
            model = self._types.meta(name).object_model
            if not isinstance(model, Unset):
                models[name] = model
        project = self._session.project
        overrides = [*([] if project is None else project.object_overrides), *here]
        message = m.OpenScene(
            scene,
            self._types.type_codes(names),
            models,
            overrides,
            self._settings.streaming_period,
            keep_going=keep_going,
            assets=self._host_world.shape_files(),
            secrets=self._secrets.values_for(scene, overrides),
            identities=self._identities(),
        )
        await self._secrets.store.flush()
        return message, overlaid

    def without_objects(self, scene: Scene) -> m.OpenScene:
        """Return the message for a host that has none of the objects yet."""
        return m.OpenScene(scene, [], streaming_period=self._settings.streaming_period, keep_going=True)

    def with_workspace(self, message: m.OpenScene, scene: Scene) -> m.OpenScene:
        """Add the present collision models and calibrations. Send the message immediately."""
        return self._host_world.with_world(message, self._host_world.calibrations(scene.objects))
