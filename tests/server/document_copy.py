"""A client's state of the open document, derived only from events, and checked as strictly as the protocol requires."""

from typing import Any

import msgspec

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene

_LISTS = {"orientations": "orientations", "robot_joints": "joints", "actions": "actions"}
_BY_ID = {"SceneObjectChanged": "objects", "ProjectParameterChanged": "parameters", "LogicItemChanged": "logic"}
_OWNED = {"OrientationChanged": "orientations", "JointsChanged": "joints", "ActionChanged": "actions"}
_TIMES = ("created", "modified", "int_modified")


class DocumentCopy:
    """Items by id. An event that does not fit (adding an existing item, updating a missing one) fails the test."""

    def __init__(self) -> None:
        self.locks: dict[str, str] = {}
        self._clear()

    def _clear(self) -> None:
        self.scene: dict[str, Any] | None = None
        self.project: dict[str, Any] | None = None
        self.items: dict[str, dict[str, Any]] = {
            kind: {}
            for kind in ("objects", "points", "orientations", "joints", "actions", "parameters", "logic", "overrides")
        }
        self.owners: dict[str, str] = {}

    @classmethod
    def of(cls, scene: Scene | None, project: Project | None) -> "DocumentCopy":
        """Return the state of a client that has just connected."""
        copy = cls()
        if scene is not None:
            copy._load(msgspec.to_builtins(scene), None if project is None else msgspec.to_builtins(project))
        return copy

    def content(self) -> dict[str, Any]:
        """Return everything except the locks, for comparison."""
        return {"scene": self.scene, "project": self.project, "owners": self.owners, **self.items}

    def apply(self, event: dict[str, Any]) -> None:
        """Apply an event."""
        name, data, change = event["event"], event.get("data"), event.get("change_type")
        match name:
            case "OpenScene" | "OpenProject":
                self._clear()
                self._load(data["scene"], data.get("project"))
            case "SceneClosed" | "ProjectClosed" | "ShowMainScreen":
                self._clear()
                self.locks.clear()
            case "ObjectsLocked":
                self.locks.update(dict.fromkeys(data["object_ids"], data["owner"]))
            case "ObjectsUnlocked":
                for key in data["object_ids"]:
                    self.locks.pop(key, None)
            case "SceneChanged" | "ProjectChanged":
                self._base(name, data)
            case "ActionPointChanged":
                self._point(change, data)
            case "OverrideUpdated":
                self._override(change, data, event["parent_id"])
            case _ if name in _BY_ID:
                self._apply_item(self.items[_BY_ID[name]], change, data)
            case _ if name in _OWNED:
                self._owned(_OWNED[name], change, data, event.get("parent_id"))

    # ------------------------------------------------------------------------------------------ whole documents
    def _load(self, scene: dict[str, Any], project: dict[str, Any] | None) -> None:
        objects = scene.pop("objects", [])
        self.scene = _untimed(scene)
        self.items["objects"] = {obj["id"]: obj for obj in objects}
        if project is None:
            return
        for point in project.pop("action_points", []):
            for field, kind in _LISTS.items():
                for item in point.pop(field, []):
                    self.items[kind][item["id"]] = item
                    self.owners[item["id"]] = point["id"]
            self.items["points"][point["id"]] = point
        for kind in ("parameters", "logic"):
            self.items[kind] = {item["id"]: item for item in project.pop(kind, [])}
        for override in project.pop("object_overrides", []):
            self.items["overrides"][override["id"]] = {p["name"]: p for p in override["parameters"]}
        self.project = _untimed(project)

    def _base(self, name: str, data: dict[str, Any]) -> None:
        document = self.scene if name == "SceneChanged" else self.project
        if document is None or document["id"] != data["id"]:
            return  # a change of a saved document, which is not open
        document.update(_untimed(data))
        if name == "ProjectChanged" and not data["has_logic"]:
            self.items["logic"].clear()  # no event is sent for each removed logic item

    # ------------------------------------------------------------------------------------------ single items
    @staticmethod
    def _apply_item(items: dict[str, Any], change: str | None, data: dict[str, Any]) -> None:
        key = data["id"]
        assert (key in items) is (change != "add"), (change, data)
        if change == "remove":
            del items[key]
        else:
            items[key] = data

    def _point(self, change: str | None, data: dict[str, Any]) -> None:
        key = data["id"]
        if data.get("parent") and change != "remove":
            assert data["parent"] in self.items["points"] or data["parent"] in self.items["objects"], data
        if change == "remove":
            assert not [p for p in self.items["points"].values() if p.get("parent") == key], data
            for item in [item for item, owner in self.owners.items() if owner == key]:
                self._forget(item)
        if change == "update":
            assert data.pop("actions") == []
            for field in ("orientations", "robot_joints"):
                items = self.items[_LISTS[field]]
                for old in [item for item in items if self.owners[item] == key]:
                    self._forget(old)
                for item in data.pop(field):
                    items[item["id"]] = item
                    self.owners[item["id"]] = key
        self._apply_item(self.items["points"], change, data)
        if change == "remove":
            self.locks.pop(key, None)

    def _forget(self, key: str) -> None:
        del self.owners[key]
        self.locks.pop(key, None)
        for kind in _LISTS.values():
            self.items[kind].pop(key, None)

    def _owned(self, kind: str, change: str | None, data: dict[str, Any], parent: str | None) -> None:
        key = data["id"]
        assert (key in self.items[kind]) is (change != "add"), (change, data)
        if change == "remove":
            self._forget(key)
            return
        if change == "add":
            assert parent in self.items["points"], (parent, data)
            self.owners[key] = parent
        self.items[kind][key] = data

    def _override(self, change: str | None, data: dict[str, Any], obj: str) -> None:
        known = self.items["overrides"].setdefault(obj, {})
        assert (data["name"] in known) is (change != "add"), (change, data)
        if change == "remove":
            del known[data["name"]]
        else:
            known[data["name"]] = data
        if not known:
            del self.items["overrides"][obj]


def _untimed(document: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in document.items() if key not in _TIMES}
