/** Which dialog is open over the screen. */

import { setUi, useEditor } from "../../store/store";
import type { Ui } from "../../store/ui";

export type Overlay = Ui["overlay"];

export function openOverlay(overlay: Overlay): void {
  setUi({ overlay });
}

export function useOverlay(): Overlay {
  return useEditor((state) => state.ui.overlay);
}

/** Return whether a key press goes into a text field. */
export function isTyping(target: EventTarget | null): boolean {
  return (
    target instanceof HTMLElement && (target.isContentEditable || /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName))
  );
}
