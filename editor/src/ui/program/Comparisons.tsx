/** The condition of a connection: one row for each comparison, and whether all or any of them have to be true. */

import { t } from "@lingui/core/macro";
import { useId, useState } from "react";
import { Changes } from "../../program/changes";
import {
  newComparison,
  operatorsOf,
  operatorWords,
  othersOf,
  withOperator,
  withOther,
} from "../../program/comparisons";
import { isRange, type Operand, operandAt } from "../../program/logic";
import type { LogicComparison, LogicWhen, Match, Operator } from "../../protocol/types";
import type { OpenDocument, State } from "../../store/state";
import { Button } from "../kit/kit";
import { ValueField } from "./ValueField";

interface ComparisonsProps {
  doc: OpenDocument;
  types: State["types"];
  when: LogicWhen;
  operands: Operand[];
  /** Id of the action from which the connection starts. */
  from: string;
  /** Text of the choice without a condition. */
  none: string;
  why: string;
  /** Send the condition; return why it was refused. */
  onSet: (when: LogicWhen) => Promise<string>;
}

export function Comparisons({ doc, types, when, operands, from, none, why, onSet }: ComparisonsProps) {
  const { comparisons, match } = when;
  const all = useId();
  const [changes] = useState(() => new Changes<LogicWhen>());
  const put = (change: (rows: LogicComparison[]) => LogicComparison[]) =>
    changes.apply(
      when,
      (last) => {
        const rows = change(last.comparisons);
        return { match: rows.length > 1 ? last.match : "all", comparisons: rows };
      },
      onSet,
    );
  const first = operands[0];
  const unused = operands.find((each) => !comparisons.some(({ what }) => what === each.what)) ?? first;
  return (
    <div className="comparisons">
      {(comparisons.length > 0 ? comparisons : [undefined]).map((one, index) => (
        <Row
          key={index}
          number={index}
          one={one}
          operand={one && operandAt(doc, types, one.what)}
          operands={operands}
          from={from}
          nameOf={(id) => doc.actions[id]?.name ?? ""}
          none={comparisons.length > 1 ? "" : none}
          why={why}
          onSet={(change) => put((rows) => rows.map((each, place) => (place === index ? change(each) : each)))}
          onChoose={(operand) =>
            put((rows) => {
              const others = rows.filter((_, place) => place !== index);
              return [...rows.slice(0, index), newComparison(operand, others), ...rows.slice(index + 1)];
            })
          }
          onClear={() => put(() => [])}
          onRemove={
            comparisons.length > 1 ? () => put((rows) => rows.filter((_, place) => place !== index)) : undefined
          }
        />
      ))}
      {comparisons.length > 1 && (
        <div className="field">
          <label htmlFor={all}>{t`True if`}</label>
          <select
            id={all}
            value={match}
            disabled={why !== ""}
            onChange={({ target }) =>
              void changes.apply(when, (last) => ({ ...last, match: target.value as Match }), onSet)
            }
          >
            <option value="all">{t`all comparisons are true`}</option>
            <option value="any">{t`at least one is true`}</option>
          </select>
        </div>
      )}
      {comparisons.length > 0 && unused && (
        <Button
          variant="plain"
          icon="plus"
          why={why}
          onPress={() => void put((rows) => [...rows, newComparison(unused, rows)])}
        >
          {t`Add a comparison`}
        </Button>
      )}
    </div>
  );
}

interface RowProps {
  number: number;
  /** Undefined without a condition. */
  one: LogicComparison | undefined;
  operand: Operand | undefined;
  operands: Operand[];
  from: string;
  nameOf: (actionId: string) => string;
  none: string;
  why: string;
  onSet: (change: (one: LogicComparison) => LogicComparison) => Promise<string>;
  onChoose: (operand: Operand) => Promise<string>;
  onClear: () => Promise<string>;
  onRemove: (() => Promise<string>) | undefined;
}

function Row({
  number,
  one,
  operand,
  operands,
  from,
  nameOf,
  none,
  why,
  onSet,
  onChoose,
  onClear,
  onRemove,
}: RowProps) {
  const id = useId();
  const other = one?.other === undefined ? undefined : operands.find((each) => each.what === one.other);
  const operators = operand ? operatorsOf(operand, other) : [];
  const others = operand ? othersOf(operand, operands) : [];
  const heading = number === 0 ? t`Condition` : t`Comparison ${number + 1}`;
  const type = operand?.type === "integer_enum" ? "integer" : (operand?.type ?? "string");
  const title = ({ actionId, name }: Operand) =>
    actionId === from ? name : actionId ? t`${name} of ${nameOf(actionId)}` : t`${name} (variable)`;
  return (
    <fieldset className="comparison" aria-label={heading}>
      <div className="field">
        <div className="value-head">
          <label htmlFor={id}>{heading}</label>
          {onRemove && (
            <Button
              variant="plain"
              icon="close"
              aria-label={t`Remove comparison ${number + 1}`}
              why={why}
              onPress={() => void onRemove()}
            />
          )}
        </div>
        <select
          id={id}
          value={one?.what ?? ""}
          disabled={why !== ""}
          onChange={(event) => {
            const chosen = operands.find((each) => each.what === event.target.value);
            void (chosen ? onChoose(chosen) : onClear());
          }}
        >
          {none && <option value="">{none}</option>}
          {one && !operands.some((each) => each.what === one.what) && (
            <option value={one.what}>{operand?.name ?? t`a result that no longer exists`}</option>
          )}
          {operands.map((each) => (
            <option key={each.what} value={each.what}>
              {title(each)}
            </option>
          ))}
        </select>
      </div>
      {one && operand && (
        <div className="comparison-values">
          {operators.length > 1 && (
            <div className="field">
              <label htmlFor={`${id}-operator`}>{t`Comparison`}</label>
              <select
                id={`${id}-operator`}
                value={one.operator}
                disabled={why !== ""}
                onChange={(event) => void onSet((last) => withOperator(last, event.target.value as Operator))}
              >
                {operators.map((each) => (
                  <option key={each} value={each}>
                    {operatorWords(each)}
                  </option>
                ))}
              </select>
            </div>
          )}
          {(others.length > 0 || one.other !== undefined) && (
            <div className="field">
              <label htmlFor={`${id}-other`}>{t`Compared with`}</label>
              <select
                id={`${id}-other`}
                value={one.other ?? ""}
                disabled={why !== ""}
                onChange={({ target }) =>
                  void onSet((last) =>
                    withOther(
                      last,
                      operand,
                      others.find((each) => each.what === target.value),
                    ),
                  )
                }
              >
                <option value="">{t`a fixed value`}</option>
                {one.other !== undefined && !others.some((each) => each.what === one.other) && (
                  <option value={one.other}>{t`a result that no longer exists`}</option>
                )}
                {others.map((each) => (
                  <option key={each.what} value={each.what}>
                    {title(each)}
                  </option>
                ))}
              </select>
            </div>
          )}
          {one.other === undefined && (
            <ValueField
              label={isRange(one.operator) ? t`From` : t`Value of ${operand.name}`}
              name={operand.name}
              type={type}
              json={one.value}
              why={why}
              onSet={(value) => onSet((last) => ({ ...last, value }))}
            />
          )}
          {isRange(one.operator) && (
            <ValueField
              label={t`To`}
              name={operand.name}
              type={type}
              json={one.upper}
              why={why}
              onSet={(upper) => onSet((last) => ({ ...last, upper }))}
            />
          )}
        </div>
      )}
    </fieldset>
  );
}
