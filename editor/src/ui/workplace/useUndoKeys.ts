/** Ctrl+Z and Shift+Ctrl+Z (Ctrl+Y): undo and redo on the server. In text fields the browser handles them. */

import { t } from "@lingui/core/macro";
import { useEffect } from "react";
import * as documents from "../../commands/documents";
import { whyUnavailable } from "../../store/permissions";
import { getState, notify } from "../../store/store";

/** Time after a step within which the event about the next one may still arrive, ms. */
const EVENT_DELAY = 1000;

export function useUndoKeys(): void {
  useEffect(() => {
    let last = -Infinity;
    const key = (event: KeyboardEvent) => {
      const wanted = undoOrRedo(event);
      if (!wanted || event.repeat || isWriting(event.target) || document.querySelector(".overlay")) return;
      event.preventDefault();
      const state = getState();
      const step = state.history?.[wanted];
      const why =
        whyUnavailable(state, wanted === "undo" ? "Undo" : "Redo") ||
        (step || event.timeStamp - last < EVENT_DELAY
          ? ""
          : wanted === "undo"
            ? t`There is nothing to undo.`
            : t`There is nothing to redo.`);
      if (why) return notify("info", why);
      last = event.timeStamp;
      void (wanted === "undo" ? documents.undo() : documents.redo());
    };
    window.addEventListener("keydown", key);
    return () => window.removeEventListener("keydown", key);
  }, []);
}

function undoOrRedo({
  key,
  ctrlKey,
  metaKey,
  shiftKey,
  altKey,
}: Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "shiftKey" | "altKey">): "undo" | "redo" | null {
  if (!(ctrlKey || metaKey) || altKey) return null;
  const letter = key.toLowerCase();
  if (letter === "z") return shiftKey ? "redo" : "undo";
  return letter === "y" && !shiftKey ? "redo" : null;
}

function isWriting(target: EventTarget | null): boolean {
  return (
    target instanceof HTMLElement &&
    (target.isContentEditable ||
      target.matches("input:not([type=checkbox], [type=radio], [type=range]), textarea, select"))
  );
}
