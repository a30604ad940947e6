/** The panel of the program: add actions, list them, check the program, edit variables. */

import { i18n } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useMemo } from "react";
import { ToggleButton, ToggleButtonGroup } from "react-aria-components";
import { problemsHere, problemsOf } from "../../program/problems";
import { setUi, useEditor } from "../../store/store";
import { AddAction } from "./AddAction";
import { Parameters } from "./Parameters";
import { Problems } from "./Problems";
import { Steps } from "./Steps";
import "./program.css";

const TABS = {
  add: msg({ message: "Add", context: "tab" }),
  steps: msg`Actions`,
  problems: msg`Check`,
  parameters: msg`Variables`,
} as const;
type Tab = keyof typeof TABS;

export default function ProgramPanel() {
  const tab = useEditor((state) => state.ui.programTab);
  const doc = useEditor((state) => state.doc);
  const types = useEditor((state) => state.types);
  const reach = useEditor((state) => state.reach);
  const problems = useMemo(() => (doc ? problemsOf(doc, types, reach) : []), [doc, types, reach]);
  const errors = problems.filter((each) => each.level === "error").length;
  return (
    <>
      <ToggleButtonGroup
        className="tabs small-tabs"
        aria-label={t`Program`}
        selectionMode="single"
        disallowEmptySelection
        selectedKeys={[tab]}
        onSelectionChange={(keys) => {
          setUi({ programTab: [...keys][0] as Tab });
        }}
      >
        {(Object.keys(TABS) as Tab[]).map((each) => (
          <ToggleButton key={each} id={each} className="tab">
            {i18n._(TABS[each])}
            {each === "problems" && problems.length > 0 && (
              <span className={`tag ${errors ? "bad" : "warn"}`}>{problems.length}</span>
            )}
          </ToggleButton>
        ))}
      </ToggleButtonGroup>
      {tab === "add" && <AddAction />}
      {tab === "steps" && <Steps problems={problemsHere(doc, problems)} />}
      {tab === "problems" && <Problems problems={problems} />}
      {tab === "parameters" && <Parameters />}
    </>
  );
}
