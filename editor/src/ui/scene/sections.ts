/** Sections about objects of the scene, loaded when they are needed. */

import { msg } from "@lingui/core/macro";
import { lazyComponent } from "../kit/lazy";
import type { Section } from "../workplace/section";

export const objectSections: readonly Section[] = [
  {
    id: "object",
    title: msg`Object`,
    applies: ({ kind }) => kind === "object",
    Body: lazyComponent(() => import("./ObjectSection")),
  },
];

export const settingsSections: readonly Section[] = [
  {
    id: "settings",
    title: msg`Settings`,
    applies: ({ kind, id }, state) =>
      kind === "object" && (state.types.byName[state.doc?.objects[id]?.type ?? ""]?.settings.length ?? 0) > 0,
    Body: lazyComponent(() => import("./SettingsSection")),
  },
];
