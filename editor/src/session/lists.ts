/** Load the lists of the home screen, the general view state, the object types and their actions. */

import type { ViewScope } from "../protocol/types";
import { translatedAction, translatedType } from "../store/objectTypeTexts";
import { getState, store } from "../store/store";
import { call, serves } from "./connection";

export async function loadTypes(): Promise<void> {
  const [types, robots] = await Promise.all([call("GetObjectTypes"), call("GetRobotMeta")]);
  store.setState({
    types: {
      byName: Object.fromEntries(types.map((type) => [type.type, translatedType(type)])),
      robots: Object.fromEntries(robots.map((robot) => [robot.type, robot])),
      actions: {},
    },
  });
}

/** Load the lists of the home screen. Events update them, except for problems, which only the lists contain. */
export async function loadLists(): Promise<void> {
  const load = async <K extends "scenes" | "projects" | "packages">(
    key: K,
    request: "ListScenes" | "ListProjects" | "ListPackages",
  ) => {
    const items = await call(request);
    store.setState((state) => ({ lists: { ...state.lists, [key]: items } }));
  };
  await Promise.all([load("scenes", "ListScenes"), load("projects", "ListProjects"), load("packages", "ListPackages")]);
}

/** Load the view state that belongs to no document: of all users, and of this user. */
export async function loadGeneralState(): Promise<void> {
  if (!serves("GetViewState")) return;
  const scopes = ["shared", "user"] as const;
  const read = (scope: ViewScope) =>
    call("GetViewState", { scope }).then(
      ({ values }) => values,
      () => ({}),
    );
  const [shared, own] = await Promise.all(scopes.map(read));
  store.setState((state) => ({ view: { ...state.view, general: { ...shared, ...own } } }));
}

/** Load the actions of a type, unless they are loaded. */
export async function loadActions(type: string): Promise<void> {
  if (type in getState().types.actions) return;
  const actions = await call("GetActions", { type });
  store.setState((state) => ({
    types: { ...state.types, actions: { ...state.types.actions, [type]: actions.map(translatedAction) } },
  }));
}
