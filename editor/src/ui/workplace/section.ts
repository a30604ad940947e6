/** A section of the panel about the selected item. */

import type { MessageDescriptor } from "@lingui/core";
import type { ComponentType } from "react";
import type { Selection, State } from "../../store/state";

export interface Section {
  id: string;
  title: MessageDescriptor;
  applies: (selection: Selection, state: State) => boolean;
  Body: ComponentType<{ selection: Selection }>;
}
