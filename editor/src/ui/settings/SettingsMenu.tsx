/** The menu of the settings: language of the user, display settings of this device, and Leave; a separate chunk. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { chooseLanguage } from "../../commands/language";
import { ask } from "../../commands/requests";
import { showWorkplaces } from "../../commands/workplaces";
import { LANGUAGES, type Language, useLanguage } from "../../i18n/catalogue";
import { ROLES } from "../../protocol/types";
import { remember } from "../../session/localStorage";
import { theSession } from "../../session/session";
import { whyUnavailable } from "../../store/permissions";
import { setUi, useEditor } from "../../store/store";
import type { Ui } from "../../store/ui";
import MoreMenu from "../kit/menu";
import type { Choice } from "../kit/props";
import { openOverlay } from "../search/overlay";

const THEMES: Record<Ui["theme"], MessageDescriptor> = {
  system: msg`System theme`,
  light: msg`Light theme`,
  dark: msg`Dark theme`,
};

export default function SettingsMenu({ defaultOpen }: { defaultOpen: boolean }) {
  const { theme, leftHanded } = useEditor((state) => state.ui);
  const { user, shared } = useEditor((state) => state.connection);
  const noPersons = useEditor((state) => whyUnavailable(state, "AddPerson"));
  const fleet = useEditor((state) => state.connection.server?.cell?.fleet);
  const language = useLanguage();
  // It needs the role that edits scenes.
  const noAudit = useEditor((state) => whyUnavailable(state, "SaveScene"));
  // Operators tour their screen, the others a program.
  const operates = useEditor((state) => state.connection.role === ROLES.operator);
  const noTour = useEditor((state) => !operates && (!state.doc?.project || location.hash !== ""));
  const choices: Choice[] = [
    { id: "find", label: t`Find a command or an object ( / )`, icon: "search", act: () => openOverlay("search") },
    ...(Object.keys(THEMES) as Ui["theme"][])
      .filter((each) => each !== theme)
      .map((each) => ({
        id: each,
        label: i18n._(THEMES[each]),
        act: () => {
          setUi({ theme: each });
          remember("theme", each === "system" ? "" : each);
        },
      })),
    ...(Object.keys(LANGUAGES) as Language[]).map((each) => ({
      id: each,
      label: LANGUAGES[each],
      icon: each === language ? ("check" as const) : undefined,
      act: () => chooseLanguage(each),
    })),
    {
      id: "hand",
      label: leftHanded ? t`Right-handed controls` : t`Left-handed controls`,
      act: () => {
        setUi({ leftHanded: !leftHanded });
        remember("hand", leftHanded ? "" : "left");
      },
    },
    {
      id: "tour",
      label: t`Guided tour`,
      icon: "play",
      why: noTour ? t`Open a project first.` : "",
      act: () => {
        if (operates) location.hash = "#/operator";
        setUi({ tour: 0 });
      },
    },
    { id: "messages", label: t`Messages`, icon: "list", act: () => openOverlay("messages") },
    { id: "interlocks", label: t`Interlocks and zones`, icon: "lock", act: () => openOverlay("interlocks") },
    { id: "production", label: t`Recipes and units`, icon: "list", act: () => openOverlay("production") },
    { id: "audit", label: t`Audit trail`, icon: "people", why: noAudit, act: () => openOverlay("audit") },
    { id: "persons", label: t`Persons`, icon: "people", why: noPersons, act: () => openOverlay("persons") },
    ...(shared ? [{ id: "pin", label: t`Change PIN`, icon: "lock" as const, act: () => openOverlay("pin") }] : []),
    { id: "about", label: t`Invite others, about, keys ( ? )`, icon: "info", act: () => openOverlay("about") },
    ...(fleet
      ? [{ id: "workplaces", label: t`All workplaces`, icon: "left" as const, act: () => void showWorkplaces(fleet) }]
      : []),
    shared
      ? { id: "leave", label: t`Log off ${user}`, icon: "close", act: () => void ask("LogOff") }
      : { id: "leave", label: t`Leave (you are ${user})`, icon: "close", act: () => theSession().leave() },
  ];
  return <MoreMenu label={t`Settings`} icon="settings" choices={choices} defaultOpen={defaultOpen} />;
}
