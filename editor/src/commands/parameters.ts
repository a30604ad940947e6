/** Parameters and variables of the project, and the device settings that it overrides. */

import type { Parameter } from "../protocol/types";
import { call } from "../session/connection";
import { getState } from "../store/store";
import { ask, refusal, withLock } from "./requests";

/** Add a project parameter. Actions can store results in a variable. */
export const addParameter = (name: string, type: string, value: string, variable = false): Promise<string> =>
  refusal(() => call("AddProjectParameter", { name, type, value, ...(variable ? { variable } : {}) }));
export const updateParameter = (id: string, change: { name?: string; value?: string }): Promise<string> =>
  refusal(() => withLock(id, () => call("UpdateProjectParameter", { id, ...change })));
export const removeParameter = (id: string) => ask("RemoveProjectParameter", { id });

/** Override a device setting in the project; `value` undefined removes the override. */
export const override = (
  objectId: string,
  setting: Omit<Parameter, "value">,
  value: string | undefined,
): Promise<string> =>
  refusal(() =>
    withLock(objectId, async () => {
      const known = getState().doc?.overrides[objectId]?.[setting.name];
      if (value === undefined) {
        if (known) await call("DeleteOverride", { id: objectId, override: known });
      } else await call(known ? "UpdateOverride" : "AddOverride", { id: objectId, override: { ...setting, value } });
    }),
  );
