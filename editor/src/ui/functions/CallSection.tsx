/** The function that an action calls: open it, or replace the call by its actions. */

import { plural, t } from "@lingui/core/macro";
import { dissolve, openFunction } from "../../commands/functions";
import { notEditable } from "../../commands/program";
import { callsOf } from "../../program/functions";
import { calledBy } from "../../program/logic";
import { parallelOf } from "../../program/parallel";
import { select, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { FunctionMenu } from "./FunctionMenu";

const CallSection: Section["Body"] = ({ selection: { id } }) => {
  const doc = useEditor((state) => state.doc);
  const why = useEditor((state) => notEditable(state, "DissolveCall"));
  const called = doc && calledBy(doc, doc.actions[id]);
  if (!doc || !called) return null;
  const calls = callsOf(doc, called.id).length;
  const owner = doc.actions[parallelOf(doc).get(id) ?? ""];
  const actions = plural(Object.keys(called.actions).length, { one: "# action", other: "# actions" });
  return (
    <>
      <p>
        <strong>{called.name}</strong>{" "}
        <span className="quiet small">
          {actions}
          {" · "}
          {plural(calls, { one: "# call", other: "# calls" })}
        </span>
      </p>
      {owner && (
        <Button variant="plain" icon="parallel" onPress={() => select({ kind: "action", id: owner.id })}>
          {t`Branch of ${owner.name}`}
        </Button>
      )}
      <div className="row">
        <Button icon="function" onPress={() => openFunction(called.id)}>
          {t`Open function`}
        </Button>
        {!owner && (
          <Button variant="plain" why={why} onPress={() => void dissolve(id)}>
            {t`Replace by its actions`}
          </Button>
        )}
        <FunctionMenu id={called.id} />
      </div>
    </>
  );
};
export default CallSection;
