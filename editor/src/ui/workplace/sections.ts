/**
 * What the panel shows of the selected thing: sections, one below the other, each for the kinds that it is about. A
 * section is a file in the folder beside this one.
 */

import type { MessageDescriptor } from "@lingui/core";
import type { ComponentType } from "react";
import type { Selection, State } from "../../store/state";
import { calibrateSections } from "../calibrate/sections";
import { pointSections } from "../points/sections";
import { programSections } from "../program/sections";
import { objectSections, settingsSections } from "../scene/sections";
import { about } from "./sections/about";
import { place } from "./sections/place";

export interface Section {
  id: string;
  title: MessageDescriptor;
  applies: (selection: Selection, state: State) => boolean;
  Body: ComponentType<{ selection: Selection }>;
}

export const SECTIONS: readonly Section[] = [
  about,
  ...pointSections,
  ...programSections,
  place,
  ...objectSections,
  ...calibrateSections,
  ...settingsSections,
];
