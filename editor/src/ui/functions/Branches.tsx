/** The branches of parallel work: their functions and values; add and remove branches, or run them in turn. */

import { t } from "@lingui/core/macro";
import { addBranch, dissolveParallel, removeBranch } from "../../commands/parallel";
import { notEditable } from "../../commands/program";
import { byName } from "../../formats";
import { lanesOf, MAX_BRANCHES, MIN_BRANCHES, whyNotAtOnce } from "../../program/lanes";
import { CALL, calledBy } from "../../program/operands";
import { callsIn } from "../../program/parallel";
import { valuesOf } from "../../program/step";
import type { Action } from "../../protocol/types";
import type { OnPoint, OpenDocument, State } from "../../store/state";
import { select, useEditor } from "../../store/store";
import { SelectField } from "../kit/fields";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { OpenButton } from "./FunctionOffers";
import "../program/program.css";
import "./functions.css";

const Branches: Section["Body"] = ({ selection: { id } }) => {
  const state = useEditor((each) => each);
  const { doc } = state;
  const action = doc?.actions[id];
  if (!doc || !action?.branches) return null;
  const calls = callsIn(doc, action);
  const why = notEditable(state, "UpdateParallel");
  const clash = whyNotAtOnce(doc, calls);
  const few = calls.length <= MIN_BRANCHES ? t`Parallel work has at least two branches.` : "";
  return (
    <>
      {clash && (
        <p className="error" role="alert">
          {clash}
        </p>
      )}
      <ul className="next-steps lanes">
        {calls.map((each) => (
          <Branch key={each.id} state={state} doc={doc} call={each} why={why || few} owner={id} />
        ))}
      </ul>
      {calls.length < MAX_BRANCHES ? (
        <SelectField
          label={t`Add a branch`}
          value=""
          choices={[["", t`choose…`], ...offers(doc, calls)]}
          isDisabled={why !== ""}
          onChange={(called) => void addBranch(id, called)}
        />
      ) : (
        <p className="quiet small">{t`Parallel work has at most four branches.`}</p>
      )}
      <div className="row">
        <Button variant="plain" why={why} onPress={() => void dissolveParallel(id)}>
          {t`Run one after the other`}
        </Button>
      </div>
    </>
  );
};
export default Branches;

/** Return the functions that can be another branch. */
const offers = (doc: OpenDocument, calls: readonly OnPoint<Action>[]): [string, string][] =>
  Object.values(doc.functions)
    .filter(({ id, name }) => whyNotAtOnce(doc, [...calls, { name, type: `${id}/${CALL}` }]) === "")
    .sort(byName)
    .map(({ id, name }) => [id, name]);

interface BranchProps {
  state: State;
  doc: OpenDocument;
  call: OnPoint<Action>;
  /** Id of the parallel action. */
  owner: string;
  /** Why it cannot be removed. */
  why: string;
}

function Branch({ state, doc, call, owner, why }: BranchProps) {
  const called = calledBy(doc, call);
  const running = state.program.running.includes(call.id);
  const doing = running && lanesOf(state).find((each) => each.id === call.id)?.doing;
  const detail = [called && t`function ${called.name}`, valuesOf(doc, state.types, call)].filter(Boolean).join(" · ");
  return (
    <li data-running={running}>
      <Button variant="plain" className="next-step" onPress={() => select({ kind: "action", id: call.id })}>
        <span>
          {call.name} {running && <span className="tag good">{t`running`}</span>}
          <span className="quiet small lane-detail">{doing || detail}</span>
        </span>
      </Button>
      {called && <OpenButton id={called.id} name={called.name} />}
      <Button
        variant="plain"
        icon="close"
        aria-label={t`Remove ${call.name}`}
        why={why}
        onPress={() => void removeBranch(owner, call.id)}
      />
    </li>
  );
}
