/** What opens over every screen: the search for commands and things, by "/"; what this is and which keys there are, by "?"; what was told. */

import { Suspense, useEffect } from "react";
import { create } from "zustand";
import { lazily } from "../kit/lazily";

const Palette = lazily(() => import("./Palette"));
const About = lazily(() => import("./About"));
const Messages = lazily(() => import("../notices/Messages"));

type Open = "" | "search" | "about" | "messages";
const useOpen = create<{ open: Open }>(() => ({ open: "" }));

export function openOverlay(open: Open): void {
  useOpen.setState({ open });
}

/** Whether a key is typed into something. */
export function writing(target: EventTarget | null): boolean {
  return (
    target instanceof HTMLElement && (target.isContentEditable || /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName))
  );
}

export function Overlays() {
  const open = useOpen((state) => state.open);
  useEffect(() => {
    const key = (event: KeyboardEvent) => {
      const wanted: Open = event.key === "/" ? "search" : event.key === "?" ? "about" : "";
      if (
        !wanted ||
        event.ctrlKey ||
        event.metaKey ||
        event.altKey ||
        writing(event.target) ||
        document.querySelector(".overlay")
      )
        return;
      event.preventDefault();
      openOverlay(wanted);
    };
    window.addEventListener("keydown", key);
    return () => window.removeEventListener("keydown", key);
  }, []);
  if (!open) return null;
  const close = () => openOverlay("");
  return (
    <Suspense fallback={null}>
      {open === "search" ? (
        <Palette onClose={close} />
      ) : open === "about" ? (
        <About onClose={close} />
      ) : (
        <Messages onClose={close} />
      )}
    </Suspense>
  );
}
