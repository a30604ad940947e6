/** Dialogs that open over every screen: search ("/"), about and keys ("?"), messages, audit trail, persons. */

import { Suspense, useEffect } from "react";
import { lazyComponent } from "../kit/lazy";
import { isTyping, type Overlay, openOverlay, useOverlay } from "./overlay";

const OVERLAYS = {
  search: lazyComponent(() => import("./Palette")),
  about: lazyComponent(() => import("./About")),
  messages: lazyComponent(() => import("../notices/Messages")),
  persons: lazyComponent(() => import("./lazyDialogs").then((more) => more.persons())),
  pin: lazyComponent(() => import("./lazyDialogs").then((more) => more.pin())),
  audit: lazyComponent(() => import("./lazyDialogs").then((more) => more.audit())),
  interlocks: lazyComponent(() => import("./lazyDialogs").then((more) => more.interlocks())),
  cell: lazyComponent(() => import("./lazyDialogs").then((more) => more.cell())),
  production: lazyComponent(() => import("./lazyDialogs").then((more) => more.production())),
};

export function Overlays() {
  const open = useOverlay();
  useEffect(() => {
    const key = (event: KeyboardEvent) => {
      const wanted: Overlay = event.key === "/" ? "search" : event.key === "?" ? "about" : "";
      if (
        !wanted ||
        event.ctrlKey ||
        event.metaKey ||
        event.altKey ||
        isTyping(event.target) ||
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
  const Opened = OVERLAYS[open];
  return (
    <Suspense fallback={null}>
      <Opened onClose={() => openOverlay("")} />
    </Suspense>
  );
}
