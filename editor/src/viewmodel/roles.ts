/** Names of roles. */

import type { MessageDescriptor } from "@lingui/core";
import { msg } from "@lingui/core/macro";
import type { AddPersonArgs } from "../protocol/types";

export type RoleName = AddPersonArgs["role"];

export const ROLE_NAMES: Record<RoleName, MessageDescriptor> = {
  operator: msg`Operator`,
  standard_user: msg`Standard user`,
  advanced_user: msg`Advanced user`,
  technician: msg`Technician`,
  programmer: msg`Programmer (administrator)`,
};
