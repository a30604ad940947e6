/** Display settings of this device, and Leave. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useEffect } from "react";
import { remember, remembered } from "../../session/localStorage";
import { theSession } from "../../session/session";
import { setUi, useEditor } from "../../store/store";
import type { Ui } from "../../store/ui";
import { More } from "../kit/lazyControls";
import type { Choice } from "../kit/props";
import { openOverlay } from "../search/overlay";

const THEMES: Record<Ui["theme"], MessageDescriptor> = {
  system: msg`System theme`,
  light: msg`Light`,
  dark: msg`Dark`,
};
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

export function Settings() {
  const { theme, leftHanded } = useEditor((state) => state.ui);
  const user = useEditor((state) => state.connection.user);
  const choices: Choice[] = [
    { id: "find", label: t`Find a command or an object ( / )`, icon: "search", act: () => openOverlay("search") },
    ...(Object.keys(THEMES) as Ui["theme"][]).map((each) => ({
      id: each,
      label: i18n._(THEMES[each]),
      icon: each === theme ? ("check" as const) : undefined,
      act: () => {
        setUi({ theme: each });
        remember("theme", each === "system" ? "" : each);
      },
    })),
    {
      id: "hand",
      label: leftHanded ? t`Right-handed controls` : t`Left-handed controls`,
      act: () => {
        setUi({ leftHanded: !leftHanded });
        remember("hand", leftHanded ? "" : "left");
      },
    },
    { id: "messages", label: t`Messages`, icon: "list", act: () => openOverlay("messages") },
    { id: "about", label: t`Invite others, about, keys ( ? )`, icon: "info", act: () => openOverlay("about") },
    { id: "leave", label: t`Leave (you are ${user})`, icon: "close", act: () => theSession().leave() },
  ];
  return <More label={t`Settings`} icon="settings" choices={choices} />;
}
