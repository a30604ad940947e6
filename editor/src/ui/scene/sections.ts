/** Sections about objects of the scene, loaded when they are needed. */

import { msg } from "@lingui/core/macro";
import { derivesFrom } from "../../store/selectors";
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
    id: "node",
    title: msg`Computer`,
    applies: ({ kind, id }, state) =>
      kind === "object" &&
      state.nodes?.configured === true &&
      !derivesFrom(state, state.doc?.objects[id]?.type ?? "", "VirtualCollisionObject"),
    Body: lazyComponent(() => import("../nodes/RunsOn")),
  },
  {
    id: "settings",
    title: msg`Settings`,
    applies: ({ kind, id }, state) =>
      kind === "object" && (state.types.byName[state.doc?.objects[id]?.type ?? ""]?.settings.length ?? 0) > 0,
    Body: lazyComponent(() => import("./SettingsSection")),
  },
];
