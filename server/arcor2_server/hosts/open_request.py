"""What the cell host is told in order to bring a scene up."""

from typing import TYPE_CHECKING, Final

from arcor2_hw.data.base import Unset
from arcor2_hw.data.object_type import ObjectModel
from arcor2_hw.data.scene import Scene
from arcor2_hw.runtime import messages as m
from arcor2_server.hosts.devices import overlay_for

if TYPE_CHECKING:
    from arcor2_server.services import Services


SHAPES: Final = (".stl", ".obj", ".ply", ".off", ".dae", ".zip", ".urdf")
"""How the ids of assets end that are meshes or models of robots."""


def shapes_put_in(services: "Services") -> dict[str, str]:
    """Give the files of the meshes and robots' models that were put in, by id: those of drivers lie beside these."""
    found = [asset.id for asset in services.assets.infos() if asset.id.lower().endswith(SHAPES)]
    return {key: str(services.assets.file(key)) for key in found}


def opening(services: "Services", scene: Scene, keep_going: bool) -> tuple[m.OpenScene, dict[str, list[str]]]:
    """Give the message, and by object the names of the settings that the server's cell file lays over the scene's.

    Raises NotFound, InvalidData.
    """
    here, overlaid = overlay_for(services, scene)
    names = {obj.type for obj in scene.objects}
    models: dict[str, ObjectModel] = {}
    for name in names:
        model = services.types.meta(name).object_model
        if not isinstance(model, Unset):
            models[name] = model
    project = services.session.project
    overrides = [*([] if project is None else project.object_overrides), *here]
    message = m.OpenScene(
        scene,
        services.types.type_codes(names),
        models,
        overrides,
        services.settings.streaming_period,
        keep_going=keep_going,
        assets=shapes_put_in(services),
        secrets=services.secrets.values_for(scene, overrides),
    )
    return message, overlaid
