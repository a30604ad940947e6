/** The whole record of a unit: facts and steps. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { shownRecipe } from "../../commands/production";
import { dateAndTime, duration } from "../../formats";
import { type Translations, translate } from "../../i18n/serverMessages";
import type { UnitRecord } from "../../protocol/types";
import { UNIT_STATES } from "./texts";
import "./production.css";

/** Return the name of a unit: its serial number, or the number of the part if it was never read. */
export const nameOf = ({ serial, part }: Pick<UnitRecord, "serial" | "part">): string => serial || `#${part}`;

interface UnitDetailsProps {
  unit: UnitRecord;
  /** Translations of the errors that came with the unit. */
  translations?: Translations | undefined;
}

export function UnitDetails({ unit, translations }: UnitDetailsProps) {
  const verdict = unit.verdict === undefined ? "–" : unit.verdict ? t`Passed` : t`Failed`;
  const facts: [string, string][] = [
    [t`State`, i18n._(UNIT_STATES[unit.state])],
    [t`Test`, verdict],
    [t`Entered the cell`, dateAndTime(unit.entered)],
    [t`Left the cell`, unit.left ? dateAndTime(unit.left) : "–"],
    [t`Order`, unit.order || "–"],
    [t`Recipe`, unit.recipe ? shownRecipe(unit.recipe) : "–"],
    [t`Package`, unit.package_name],
    [t`Started by`, unit.started_by || "–"],
    [
      t`Calibrations`,
      unit.calibrations.map(({ object_name, date }) => `${object_name}, ${dateAndTime(date)}`).join("; ") || "–",
    ],
  ];
  return (
    <>
      <dl className="facts">
        {facts.map(([name, value]) => (
          <div key={name}>
            <dt className="quiet small">{name}</dt>
            <dd data-name>{value}</dd>
          </div>
        ))}
      </dl>
      <div className="units" tabIndex={0} role="group" aria-label={t`Steps`}>
        <ol>
          {unit.steps.map(({ name, started, ...step }) => (
            <li key={`${step.run}-${step.number}`}>
              <strong data-name>{name}</strong> <span className="quiet small">{dateAndTime(started)}</span>{" "}
              {step.duration !== undefined && <span className="quiet small">{duration(step.duration)}</span>}{" "}
              {step.results && <span data-name>{step.results.join(", ")}</span>}
              {step.error && (
                <span className="error small">{translate({ ...step, text: step.error }, translations)}</span>
              )}
            </li>
          ))}
        </ol>
      </div>
    </>
  );
}
