/** A section of the panel about the selected item. */

import type { MessageDescriptor } from "@lingui/core";
import type { ComponentType } from "react";
import type { State } from "../../store/state";
import type { Selection } from "../../store/ui";

export interface Section {
  id: string;
  title: MessageDescriptor;
  applies: (selection: Selection, state: State) => boolean;
  Body: ComponentType<{ selection: Selection }>;
}
