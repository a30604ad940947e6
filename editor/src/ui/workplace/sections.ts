/** The sections of the panel about the selected item, from top to bottom. */

import { calibrateSections } from "../calibrate/sections";
import { pointSections } from "../points/sections";
import { programSections } from "../program/sections";
import { objectSections, settingsSections } from "../scene/sections";
import type { Section } from "./section";
import { about } from "./sections/about";
import { place } from "./sections/place";

export const SECTIONS: readonly Section[] = [
  about,
  ...pointSections,
  ...programSections,
  place,
  ...objectSections,
  ...calibrateSections,
  ...settingsSections,
];
