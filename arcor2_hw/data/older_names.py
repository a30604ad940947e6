"""Names that sources written for ARCOR2 import, and their replacements here (protocol, sections 9.6 and 9.2).

The table is used to read such sources (`analysis`) and to run them (`runtime.older`).
"""

from typing import Final

from arcor2_hw.messages import Message

_GEOMETRY: Final = "arcor2_hw.data.geometry"
_MODELS: Final = "arcor2_hw.data.object_type"
_PROJECT: Final = "arcor2_hw.data.project"
_ROBOT: Final = "arcor2_hw.data.robot"
_OLDER: Final = "arcor2_hw.runtime.older"


def _all_from(module: str, *names: str) -> dict[str, tuple[str, str]]:
    return {name: (module, name) for name in names}


OLDER_NAMES: Final[dict[str, dict[str, tuple[str, str]]]] = {
    "arcor2": _all_from(f"{_OLDER}.declarations", "DynamicParamTuple"),
    "arcor2.data": {},
    "arcor2.data.camera": _all_from("arcor2_hw.data.camera", "CameraParameters"),
    "arcor2.data.common": {
        **_all_from(_MODELS, "ActionMetadata"),
        **_all_from("arcor2_hw.actions", "IntEnum", "StrEnum"),
        **_all_from(_GEOMETRY, "Orientation", "Pose", "Position"),
        **_all_from(_PROJECT, "ActionPoint", "ProjectRobotJoints"),
        **_all_from(_ROBOT, "Joint"),
    },
    "arcor2.data.object_type": _all_from(_MODELS, "Box", "Cylinder", "Mesh", "Models", "Sphere"),
    "arcor2.data.robot": _all_from(_ROBOT, "InverseKinematicsRequest", "RobotType"),
    "arcor2.exceptions": {
        "Arcor2Exception": ("arcor2_hw.exceptions", "Arcor2Error"),
        **_all_from("arcor2_hw.exceptions", "Arcor2NotImplemented"),
    },
    "arcor2.json": _all_from(f"{_OLDER}.json", "JsonException", "dumps", "loads", "loads_type"),
    "arcor2.logging": _all_from(f"{_OLDER}.logging", "get_logger"),
    "arcor2.transformations": _all_from(_GEOMETRY, "make_pose_abs", "make_pose_rel"),
    "arcor2_object_types": {},
    "arcor2_object_types.abstract": _all_from(
        "arcor2_hw.objects",
        "Camera",
        "CollisionObject",
        "Generic",
        "GenericWithPose",
        "MultiArmRobot",
        "Robot",
        "RobotException",
        "Settings",
        "VirtualCollisionObject",
    ),
    "arcor2_runtime": {},
    "arcor2_runtime.exceptions": _all_from("arcor2_hw.runtime.exceptions", "print_exception"),
    "arcor2_runtime.resources": _all_from("arcor2_hw.runtime.older_resources", "Resources"),
    "arcor2_web": {},
    "arcor2_web.rest": _all_from(
        f"{_OLDER}.rest", "Method", "RestException", "RestHttpException", "Timeout", "call", "get_image"
    ),
}
"""Our module and name, by module and name in ARCOR2."""

OLDER_PACKAGES: Final = frozenset(name for name in OLDER_NAMES if "." not in name)


def is_older(module: str) -> bool:
    """Return whether a module belongs to ARCOR2."""
    return module.partition(".")[0] in OLDER_PACKAGES


def not_offered(module: str, name: str | None = None) -> Message | None:
    """Return a message that a module or name of ARCOR2 is not available, or None if it is, or is not part of ARCOR2."""
    if not is_older(module):
        return None
    known, *rest = module.split(".")
    if name not in (None, "*"):
        rest.append(str(name))
    for part in rest:
        wanted = f"{known}.{part}"
        if wanted not in OLDER_NAMES:
            if part in OLDER_NAMES[known] and part is rest[-1]:
                return None
            available = ", ".join(_within(known))
            text = "{wanted} is not available. Available in {module}: {available}"
            return Message.of(text, wanted=wanted, module=known, available=available)
        known = wanted
    return None


def _within(module: str) -> list[str]:
    """Return the names and modules in a module."""
    below = [each.rpartition(".")[2] for each in OLDER_NAMES if each.rpartition(".")[0] == module]
    return sorted({*OLDER_NAMES[module], *below})
