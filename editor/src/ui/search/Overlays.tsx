/** Dialogs that open over every screen: search ("/"), about and keys ("?"), messages. */

import { Suspense, useEffect } from "react";
import { lazyComponent } from "../kit/lazy";
import { isTyping, type Overlay, openOverlay, useOverlay } from "./overlay";

const Palette = lazyComponent(() => import("./Palette"));
const About = lazyComponent(() => import("./About"));
const Messages = lazyComponent(() => import("../notices/Messages"));

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
