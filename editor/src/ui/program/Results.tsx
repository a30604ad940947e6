/** Results of an action: their names, and the actions that use them. */

import { t } from "@lingui/core/macro";
import { useState } from "react";
import { nameResults, notEditable } from "../../commands/program";
import { metaOf } from "../../program/logic";
import { newOutputs } from "../../program/naming";
import { usersOf } from "../../program/problems";
import { typeName } from "../../program/values";
import { select, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { ValueField } from "./ValueField";
import "./program.css";

const Results: Section["Body"] = ({ selection: { id } }) => {
  const state = useEditor((each) => each);
  const [problem, setProblem] = useState("");
  const { doc, types } = state;
  const action = doc?.actions[id];
  if (!doc || !action) return null;
  const returns = metaOf(types, doc, action)?.returns ?? [];
  const outputs = action.flows[0]?.outputs ?? [];
  const why = notEditable(state);
  if (returns.length === 0) return <p className="quiet small">{t`Nothing.`}</p>;
  if (outputs.length === 0) {
    return (
      <>
        <p className="quiet small">{t`Results are not stored.`}</p>
        <Button
          why={why}
          onPress={() =>
            void nameResults(id, newOutputs(doc, action.type.split("/")[1] ?? action.name, returns.length)).then(
              setProblem,
            )
          }
        >
          {t`Store results`}
        </Button>
        {problem && (
          <p className="error" role="alert">
            {problem}
          </p>
        )}
      </>
    );
  }
  const users = usersOf(doc, types, { action: id });
  return (
    <>
      {returns.map((type, index) => (
        <ValueField
          key={`${id}/${index}`}
          label={typeName(type)}
          name={t`Name of result ${index + 1}`}
          type="string"
          json={JSON.stringify(outputs[index] ?? "")}
          why={why}
          onSet={(json) =>
            nameResults(
              id,
              outputs.map((each, at) => (at === index ? (JSON.parse(json) as string) : each)),
            )
          }
        />
      ))}
      {users.length > 0 && (
        <p className="small">
          {t`Used by`}{" "}
          {users.map((each) => (
            <Button key={each} look="plain" onPress={() => select({ kind: "action", id: each })}>
              {doc.actions[each]?.name}
            </Button>
          ))}
        </p>
      )}
    </>
  );
};
export default Results;
