"""A client's state of the open document, derived only from events, and checked as strictly as the protocol requires."""

from typing import Any

import msgspec

from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene

_LISTS = {"orientations": "orientations", "robot_joints": "joints", "actions": "actions"}
_BY_ID = {"SceneObjectChanged": "objects", "ProjectParameterChanged": "parameters", "LogicItemChanged": "logic"}
_OWNED = {"OrientationChanged": "orientations", "JointsChanged": "joints", "ActionChanged": "actions"}
_TIMES = ("created", "modified", "int_modified")


class Picture:
    """Items by id. An event that does not fit (adding an existing item, updating a missing one) fails the test."""

    def __init__(self) -> None:
        self.locks: dict[str, str] = {}
        self._clear()

    def _clear(self) -> None:
        self.scene: dict[str, Any] | None = None
        self.project: dict[str, Any] | None = None
        self.things: dict[str, dict[str, Any]] = {
            kind: {}
            for kind in ("objects", "points", "orientations", "joints", "actions", "parameters", "logic", "overrides")
        }
        self.owners: dict[str, str] = {}

    @classmethod
    def of(cls, scene: Scene | None, project: Project | None) -> "Picture":
        """Return the state of a client that has just connected."""
        picture = cls()
        if scene is not None:
            picture._load(msgspec.to_builtins(scene), None if project is None else msgspec.to_builtins(project))
        return picture

    def shown(self) -> dict[str, Any]:
        """Return everything except the locks, for comparison."""
        return {"scene": self.scene, "project": self.project, "owners": self.owners, **self.things}

    def see(self, event: dict[str, Any]) -> None:
        """Take in an event."""
        name, data, how = event["event"], event.get("data"), event.get("change_type")
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
                self._point(how, data)
            case "OverrideUpdated":
                self._override(how, data, event["parent_id"])
            case _ if name in _BY_ID:
                self._thing(self.things[_BY_ID[name]], how, data)
            case _ if name in _OWNED:
                self._owned(_OWNED[name], how, data, event.get("parent_id"))

    # ------------------------------------------------------------------------------------------ whole documents
    def _load(self, scene: dict[str, Any], project: dict[str, Any] | None) -> None:
        objects = scene.pop("objects", [])
        self.scene = _untimed(scene)
        self.things["objects"] = {obj["id"]: obj for obj in objects}
        if project is None:
            return
        for point in project.pop("action_points", []):
            for field, kind in _LISTS.items():
                for thing in point.pop(field, []):
                    self.things[kind][thing["id"]] = thing
                    self.owners[thing["id"]] = point["id"]
            self.things["points"][point["id"]] = point
        for kind in ("parameters", "logic"):
            self.things[kind] = {thing["id"]: thing for thing in project.pop(kind, [])}
        for override in project.pop("object_overrides", []):
            self.things["overrides"][override["id"]] = {p["name"]: p for p in override["parameters"]}
        self.project = _untimed(project)

    def _base(self, name: str, data: dict[str, Any]) -> None:
        mine = self.scene if name == "SceneChanged" else self.project
        if mine is None or mine["id"] != data["id"]:
            return  # of a saved one
        mine.update(_untimed(data))
        if name == "ProjectChanged" and not data["has_logic"]:
            self.things["logic"].clear()  # these have no events of their own

    # ------------------------------------------------------------------------------------------ single things
    @staticmethod
    def _thing(things: dict[str, Any], how: str | None, data: dict[str, Any]) -> None:
        key = data["id"]
        assert (key in things) is (how != "add"), (how, data)
        if how == "remove":
            del things[key]
        else:
            things[key] = data

    def _point(self, how: str | None, data: dict[str, Any]) -> None:
        key = data["id"]
        if data.get("parent") and how != "remove":
            assert data["parent"] in self.things["points"] or data["parent"] in self.things["objects"], data
        if how == "remove":
            assert not [p for p in self.things["points"].values() if p.get("parent") == key], data
            for thing in [thing for thing, owner in self.owners.items() if owner == key]:
                self._forget(thing)
        if how == "update":
            assert data.pop("actions") == []
            for field in ("orientations", "robot_joints"):
                things = self.things[_LISTS[field]]
                for old in [thing for thing in things if self.owners[thing] == key]:
                    self._forget(old)
                for thing in data.pop(field):
                    things[thing["id"]] = thing
                    self.owners[thing["id"]] = key
        self._thing(self.things["points"], how, data)
        if how == "remove":
            self.locks.pop(key, None)

    def _forget(self, key: str) -> None:
        del self.owners[key]
        self.locks.pop(key, None)
        for kind in _LISTS.values():
            self.things[kind].pop(key, None)

    def _owned(self, kind: str, how: str | None, data: dict[str, Any], parent: str | None) -> None:
        key = data["id"]
        assert (key in self.things[kind]) is (how != "add"), (how, data)
        if how == "remove":
            self._forget(key)
            return
        if how == "add":
            assert parent in self.things["points"], (parent, data)
            self.owners[key] = parent
        self.things[kind][key] = data

    def _override(self, how: str | None, data: dict[str, Any], obj: str) -> None:
        known = self.things["overrides"].setdefault(obj, {})
        assert (data["name"] in known) is (how != "add"), (how, data)
        if how == "remove":
            del known[data["name"]]
        else:
            known[data["name"]] = data
        if not known:
            del self.things["overrides"][obj]


def _untimed(document: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in document.items() if key not in _TIMES}
