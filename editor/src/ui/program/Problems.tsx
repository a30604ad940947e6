/** Problems of the program; a tap selects the faulty item. */

import { t } from "@lingui/core/macro";
import { Button as AriaButton } from "react-aria-components";
import type { Problem } from "../../program/problems";
import { theEngine } from "../../session/engine";
import { scopeOf } from "../../store/scope";
import { getState, select, setUi, showFunction, useEditor } from "../../store/store";
import { selectionOf, withNames } from "../../viewmodel/names";
import { Icon } from "../kit/icons";

export function Problems({ problems }: { problems: Problem[] }) {
  const known = useEditor((state) =>
    Object.values(state.doc?.objects ?? {}).every(
      (each) => each.type in state.types.actions || !(each.type in state.types.byName),
    ),
  );
  if (!known) return <p className="quiet">{t`Loading actions…`}</p>;
  if (problems.length === 0) {
    return (
      <p className="all-well">
        <Icon name="check" /> {t`No problems. Ready to run.`}
      </p>
    );
  }
  const sorted = [...problems].sort((a, b) => Number(a.level === "warn") - Number(b.level === "warn"));
  return (
    <ul className="faults">
      {sorted.map((each, index) => (
        <li key={`${each.id}/${index}`}>
          <AriaButton
            className={`fault ${each.level}`}
            onPress={() => {
              if (each.scope !== scopeOf(getState().doc ?? { path: [] })) showFunction(each.scope ? [each.scope] : []);
              select(selectionOf(getState(), each.id));
              setUi({ tool: "" });
              theEngine()?.focus(each.id);
            }}
          >
            <Icon name={each.level === "error" ? "warn" : "info"} />
            <span>
              <span className="hidden-but-read">{each.level === "error" ? t`Error:` : t`Warning:`} </span>
              {withNames(getState(), each.text)}
            </span>
          </AriaButton>
        </li>
      ))}
    </ul>
  );
}
