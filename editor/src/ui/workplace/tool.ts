/** A tool of the rail on the left: an icon, a word, and the panel that is shown while it is open. */

import type { MessageDescriptor } from "@lingui/core";
import type { ComponentType } from "react";
import type { State } from "../../store/state";
import type { IconName } from "../kit/icons";

export interface Tool {
  id: string;
  label: MessageDescriptor;
  icon: IconName;
  /** Whether the rail shows it; by default it does. */
  shown?: (state: State) => boolean;
  /** Return why it cannot be used now, as a sentence; an empty string if it can. */
  whyUnavailable?: (state: State) => string;
  Panel: ComponentType;
}
