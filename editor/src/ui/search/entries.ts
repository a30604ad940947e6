/** All that the search finds: commands of the screen, tools, things, and what can be opened, each as words. */

import { barred } from "../../commands/asking";
import * as documents from "../../commands/documents";
import { goOffline, goOnline, stopMotion } from "../../commands/operation";
import { keepGeneral } from "../../commands/viewstate";
import { aimsAlways } from "../../session/aiming";
import { theEngine } from "../../session/engine";
import { remember } from "../../session/memory";
import { leave } from "../../session/session";
import { isRunning } from "../../store/selectors";
import type { State } from "../../store/state";
import { now, select, setUi } from "../../store/store";
import { allOf, thingsOf } from "../../viewmodel/things";
import { KINDS, selectionOf } from "../names";
import { TOOLS } from "../workplace/tools";
import type { Entry } from "./found";
import { openOverlay } from "./Overlays";

export function entriesOf(state: State): Entry[] {
  return [...(state.doc ? [...ofWorkplace(state), ...things(state)] : ofHome(state)), ...everywhere(state)];
}

function ofWorkplace(state: State): Entry[] {
  const { history, live } = state;
  const entry = (id: string, words: string, why: string, act: () => unknown, detail = "command"): Entry => ({
    id,
    words,
    detail,
    why,
    act: () => void act(),
  });
  const cannotSave =
    barred(state, state.doc?.project ? "SaveProject" : "SaveScene") ||
    (state.doc?.unsaved ? "" : "Nothing has changed.");
  const cannotUndo = barred(state, "Undo");
  const cannotSwitch = barred(state, "StartScene") || (isRunning(state) ? "A program runs." : "");
  const online = live.state === "started";
  return [
    ...(online ? [entry("stop", "Stop motion", "", stopMotion, "command, no emergency stop")] : []),
    ...TOOLS.filter((tool) => tool.shown?.(state) ?? true).map((tool) =>
      entry(`tool/${tool.id}`, tool.label, tool.barred?.(state) ?? "", () => setUi({ tool: tool.id }), "tool"),
    ),
    entry("save", "Save", cannotSave, documents.save),
    entry(
      "undo",
      history?.undo ? `Undo ${history.undo.text}` : "Undo",
      cannotUndo || (history?.undo ? "" : "There is nothing to undo."),
      documents.undo,
    ),
    entry(
      "redo",
      history?.redo ? `Redo ${history.redo.text}` : "Redo",
      cannotUndo || (history?.redo ? "" : "There is nothing to redo."),
      documents.redo,
    ),
    online
      ? entry("offline", "Go offline", cannotSwitch, goOffline)
      : entry("online", "Go online", cannotSwitch || (live.state === "stopped" ? "" : "It is on its way."), goOnline),
    entry("cross", aimsAlways(state) ? "No more picking by the cross" : "Pick by the cross", "", () =>
      keepGeneral({ aiming: !aimsAlways(state) || null }),
    ),
    entry("all", "Show all in the view", "", () => theEngine()?.focus()),
    ...(state.ui.selection
      ? [entry("zoom", "Zoom to what is selected", "", () => theEngine()?.focus(now().ui.selection?.id))]
      : []),
  ];
}

function things(state: State): Entry[] {
  const rows = allOf(thingsOf(state)).filter((each) => each.kind !== "logic");
  return rows.map(({ id, name, kind, detail }) => ({
    id,
    words: name,
    detail: kind === "object" ? detail : KINDS[kind].toLowerCase(),
    why: "",
    act: () => {
      select(selectionOf(now(), id));
      setUi({ tool: "" });
      theEngine()?.focus(id);
    },
  }));
}

function ofHome(state: State): Entry[] {
  const open = (kind: "project" | "scene", id: string, name: string): Entry => ({
    id,
    words: `Open ${name}`,
    detail: kind,
    why: barred(state, kind === "scene" ? "OpenScene" : "OpenProject"),
    act: () => void (kind === "scene" ? documents.openScene(id) : documents.openProject(id)),
  });
  return [
    ...(state.lists.projects ?? []).map((each) => open("project", each.id, each.name)),
    ...(state.lists.scenes ?? []).map((each) => open("scene", each.id, each.name)),
  ];
}

function everywhere(state: State): Entry[] {
  const { theme, leftHanded } = state.ui;
  const themes = { system: "Colours as the device has them", light: "Light colours", dark: "Dark colours" } as const;
  return [
    ...(["system", "light", "dark"] as const)
      .filter((each) => each !== theme)
      .map((each) => ({
        id: `theme/${each}`,
        words: themes[each],
        detail: "setting",
        why: "",
        act: () => {
          setUi({ theme: each });
          remember("theme", each === "system" ? "" : each);
        },
      })),
    {
      id: "hand",
      words: leftHanded ? "Controls for the right hand" : "Controls for the left hand",
      detail: "setting",
      why: "",
      act: () => {
        setUi({ leftHanded: !leftHanded });
        remember("hand", leftHanded ? "" : "left");
      },
    },
    {
      id: "messages",
      words: "Messages: what was told, with times",
      detail: "help",
      why: "",
      act: () => openOverlay("messages"),
    },
    {
      id: "about",
      words: "About, keys, invite others, diagnosis",
      detail: "help",
      why: "",
      act: () => openOverlay("about"),
    },
    { id: "leave", words: "Leave", detail: "command", why: "", act: leave },
  ];
}
