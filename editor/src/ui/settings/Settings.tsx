/** The settings button, and the display settings of this device. */

import { t } from "@lingui/core/macro";
import { Suspense, useEffect, useState } from "react";
import { remembered } from "../../session/localStorage";
import { setUi, useEditor } from "../../store/store";
import type { Ui } from "../../store/ui";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";

const SettingsMenu = lazyComponent(() => import("./SettingsMenu"));
const dark = window.matchMedia("(prefers-color-scheme: dark)");

export function useTheme(): "light" | "dark" {
  const wanted = useEditor((state) => state.ui.theme);
  const system = useEditor((state) => state.ui.systemDark);
  return wanted === "system" ? (system ? "dark" : "light") : wanted;
}

/** Apply the settings stored in this browser, and follow the system theme. */
export function useScreenSettings(): void {
  const theme = useTheme();
  const left = useEditor((state) => state.ui.leftHanded);
  useEffect(() => {
    const follow = () => setUi({ systemDark: dark.matches });
    setUi({
      theme: (remembered("theme") || "system") as Ui["theme"],
      leftHanded: remembered("hand") === "left",
      systemDark: dark.matches,
    });
    dark.addEventListener("change", follow);
    return () => dark.removeEventListener("change", follow);
  }, []);
  useEffect(() => {
    document.documentElement.dataset.theme = theme;
    document.documentElement.dataset.hand = left ? "left" : "right";
  }, [theme, left]);
}

/** A button that opens the menu; if it is pressed before the menu is loaded, the menu opens as soon as it is. */
export function Settings() {
  const [pressed, setPressed] = useState(false);
  return (
    <Suspense
      fallback={
        <Button variant="plain" icon="settings" aria-label={t`Settings`} onPressStart={() => setPressed(true)} />
      }
    >
      <SettingsMenu defaultOpen={pressed} />
    </Suspense>
  );
}
