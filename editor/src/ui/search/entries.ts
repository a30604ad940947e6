/** Entries of the search: commands, tools, items and documents. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import * as documents from "../../commands/documents";
import { notPredictable, startDryRun } from "../../commands/dryRun";
import { openFunction } from "../../commands/functions";
import { chooseLanguage } from "../../commands/language";
import { goOffline, goOnline, stopMotion } from "../../commands/operation";
import { storeGeneralState } from "../../commands/viewstate";
import { LANGUAGES, type Language } from "../../i18n/catalogue";
import { translate } from "../../i18n/serverMessages";
import { aimsAlways } from "../../session/aiming";
import { serves } from "../../session/connection";
import { theEngine } from "../../session/engine";
import { remember } from "../../session/localStorage";
import { theSession } from "../../session/session";
import { whyUnavailable } from "../../store/permissions";
import { isClosed } from "../../store/selectors";
import type { State } from "../../store/state";
import { getState, select, setUi } from "../../store/store";
import { kindName, selectionOf } from "../../viewmodel/names";
import { allOf, thingsOf } from "../../viewmodel/things";
import { openPoints } from "../io/address";
import { TOOLS } from "../workplace/tools";
import type { Entry } from "./matches";
import { openOverlay } from "./overlay";

export function entriesOf(state: State): Entry[] {
  return [
    ...(state.doc ? [...ofWorkplace(state), ...things(state), ...inFunctions(state)] : ofHome(state)),
    ...everywhere(state),
  ];
}

/** Start a dry run, and show its panel. */
function predict() {
  setUi({ tool: "run" });
  return startDryRun();
}

function ofWorkplace(state: State): Entry[] {
  const { history, live } = state;
  const entry = (id: string, words: string, why: string, act: () => unknown, detail = t`command`): Entry => ({
    id,
    words,
    detail,
    why,
    act: () => void act(),
  });
  const cannotSave =
    whyUnavailable(state, state.doc?.project ? "SaveProject" : "SaveScene") ||
    (state.doc?.unsaved ? "" : t`No unsaved changes.`);
  const cannotUndo = whyUnavailable(state, "Undo");
  const cannotSwitch = whyUnavailable(state, "StartScene") || (isClosed(state) ? t`A program is running.` : "");
  const online = live.state === "started";
  return [
    ...(online ? [entry("stop", t`Stop motion`, "", stopMotion, t`command, not an emergency stop`)] : []),
    ...TOOLS.filter((tool) => tool.shown?.(state) ?? true).map((tool) =>
      entry(
        `tool/${tool.id}`,
        i18n._(tool.label),
        tool.whyUnavailable?.(state) ?? "",
        () => setUi({ tool: tool.id }),
        t`tool`,
      ),
    ),
    entry("save", t`Save`, cannotSave, documents.save),
    entry(
      "undo",
      history?.undo ? t`Undo ${translate(history.undo)}` : t`Undo`,
      cannotUndo || (history?.undo ? "" : t`There is nothing to undo.`),
      documents.undo,
    ),
    entry(
      "redo",
      history?.redo ? t`Redo ${translate(history.redo)}` : t`Redo`,
      cannotUndo || (history?.redo ? "" : t`There is nothing to redo.`),
      documents.redo,
    ),
    online
      ? entry("offline", t`Go offline`, cannotSwitch, goOffline)
      : entry(
          "online",
          t`Go online`,
          cannotSwitch || (live.state === "stopped" ? "" : t`Wait until the change of state is complete.`),
          goOnline,
        ),
    entry("io", t`Inputs and outputs`, "", openPoints, t`page`),
    ...(state.doc?.project ? [entry("dry-run", t`Dry run`, notPredictable(state), predict)] : []),
    entry("cross", aimsAlways(state) ? t`Close the crosshair` : t`Select with crosshair`, "", () =>
      storeGeneralState({ aiming: !aimsAlways(state) || null }),
    ),
    entry("all", t`Show all in the view`, "", () => theEngine()?.focus()),
    ...(state.ui.selection
      ? [entry("zoom", t`Zoom to selection`, "", () => theEngine()?.focus(getState().ui.selection?.id))]
      : []),
  ];
}

function things(state: State): Entry[] {
  const rows = allOf(thingsOf(state)).filter((each) => each.kind !== "logic");
  return rows.map(({ id, name, kind, detail }) => ({
    id,
    words: name,
    detail: kind === "object" ? detail : kindName(kind),
    why: "",
    act: () => {
      select(selectionOf(getState(), id));
      setUi({ tool: "" });
      theEngine()?.focus(id);
    },
  }));
}

/** Return the functions, and the actions of those that are not open. */
function inFunctions({ doc }: State): Entry[] {
  if (!doc) return [];
  return Object.values(doc.functions).flatMap(({ id, name, actions }) => {
    const hidden = Object.values(actions).filter((each) => !(each.id in doc.actions));
    return [
      { id, words: name, detail: t`function`, why: "", act: () => openFunction(id) },
      ...hidden.map(
        (each): Entry => ({
          id: each.id,
          words: each.name,
          detail: t`action of ${name}`,
          why: "",
          act: () => select({ kind: "action", id: each.id }),
        }),
      ),
    ];
  });
}

function ofHome(state: State): Entry[] {
  const open = (kind: "project" | "scene", id: string, name: string): Entry => ({
    id,
    words: t`Open ${name}`,
    detail: kind === "scene" ? t`scene` : t`project`,
    why: whyUnavailable(state, kind === "scene" ? "OpenScene" : "OpenProject"),
    act: () => void (kind === "scene" ? documents.openScene(id) : documents.openProject(id)),
  });
  return [
    ...(state.lists.projects ?? []).map((each) => open("project", each.id, each.name)),
    ...(state.lists.scenes ?? []).map((each) => open("scene", each.id, each.name)),
  ];
}

function everywhere(state: State): Entry[] {
  const { theme, leftHanded } = state.ui;
  const themes = { system: t`System theme`, light: t`Light theme`, dark: t`Dark theme` } as const;
  return [
    ...(["system", "light", "dark"] as const)
      .filter((each) => each !== theme)
      .map((each) => ({
        id: `theme/${each}`,
        words: themes[each],
        detail: t`setting`,
        why: "",
        act: () => {
          setUi({ theme: each });
          remember("theme", each === "system" ? "" : each);
        },
      })),
    ...(Object.entries(LANGUAGES) as [Language, string][])
      .filter(([each]) => each !== i18n.locale)
      .map(([each, words]) => ({
        id: `language/${each}`,
        words,
        detail: t`language`,
        why: "",
        act: () => chooseLanguage(each),
      })),
    {
      id: "hand",
      words: leftHanded ? t`Right-handed controls` : t`Left-handed controls`,
      detail: t`setting`,
      why: "",
      act: () => {
        setUi({ leftHanded: !leftHanded });
        remember("hand", leftHanded ? "" : "left");
      },
    },
    ...(serves("GetCell")
      ? [{ id: "cell", words: t`Mode and authority`, detail: t`page`, why: "", act: () => openOverlay("cell") }]
      : []),
    {
      id: "messages",
      words: t`Messages`,
      detail: t`help`,
      why: "",
      act: () => openOverlay("messages"),
    },
    {
      id: "about",
      words: t`About, keys, invite others, diagnosis`,
      detail: t`help`,
      why: "",
      act: () => openOverlay("about"),
    },
    { id: "leave", words: t`Leave`, detail: t`command`, why: "", act: () => theSession().leave() },
  ];
}
