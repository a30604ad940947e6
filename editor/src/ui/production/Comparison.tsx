/** Two recipes side by side, before the cell is changed over. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { shownRecipe } from "../../commands/production";
import { refusal } from "../../commands/requests";
import { dateAndTime, decimal } from "../../formats";
import type { Recipe, RecipeComparison } from "../../protocol/types";
import { call } from "../../session/connection";
import { useEditor } from "../../store/store";
import { Button, Waiting } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { RECIPE_STATES } from "./texts";

interface Props {
  before: Recipe;
  after: Recipe;
  busy: boolean;
  refused: string;
  canChange: boolean;
  onChange: () => void;
  onClose: () => void;
}

export function Comparison({ before, after, busy, refused, canChange, onChange, onClose }: Props) {
  const packages = useEditor((state) => state.lists.packages) ?? [];
  const [found, setFound] = useState<RecipeComparison | null>(null);
  const loading = useRefusal();
  useEffect(() => {
    void loading.ask(
      refusal(async () => setFound(await call("CompareRecipes", { before: before.id, after: after.id }))),
    );
  }, [before.id, after.id]);
  const pair = [before, after] as const;
  const names = [...new Set(pair.flatMap((each) => each.values.map(({ name }) => name)))];
  const valueIn = (recipe: Recipe, name: string) => {
    const value = recipe.values.find((each) => each.name === name)?.value;
    return value === undefined ? t`as in the package` : value;
  };
  const rows: [string, (recipe: Recipe) => string][] = [
    [t`State`, ({ state }) => i18n._(RECIPE_STATES[state])],
    [t`Package`, ({ package_id }) => packages.find(({ id }) => id === package_id)?.package_meta.name ?? package_id],
    [t`Planned parts per hour`, ({ planned_rate }) => (planned_rate === undefined ? "–" : decimal(planned_rate))],
    [
      t`Signed`,
      ({ signatures }) => signatures.slice(-1).map(({ name, at }) => `${name}, ${dateAndTime(at)}`)[0] ?? "–",
    ],
    ...names.map((name): [string, (recipe: Recipe) => string] => [name, (recipe) => valueIn(recipe, name)]),
  ];
  return (
    <>
      <div className="compared" tabIndex={0} role="group" aria-label={t`Comparison`}>
        <table>
          <thead>
            <tr>
              <td />
              <th scope="col" data-name={before.product}>
                {shownRecipe(before)}
              </th>
              <th scope="col" data-name={after.product}>
                {shownRecipe(after)}
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map(([name, shown]) => (
              <tr key={name} data-differs={shown(before) !== shown(after)}>
                <th scope="row" data-name={name}>
                  {name}
                </th>
                <td data-name>{shown(before)}</td>
                <td data-name>{shown(after)}</td>
              </tr>
            ))}
          </tbody>
        </table>
        {found === null && !loading.refused && <Waiting>{t`Loading…`}</Waiting>}
        {found?.problems.map((problem) => (
          <p key={problem} className="error" role="alert">
            {problem}
          </p>
        ))}
        {found && found.files.length === 0 && <p className="quiet">{t`The packages have the same content.`}</p>}
        {found && found.files.length > 0 && (
          <details>
            <summary>{t`Changed files: ${found.files.length}`}</summary>
            <ul data-name>
              {found.files.map(({ path }) => (
                <li key={path}>{path}</li>
              ))}
            </ul>
            <pre data-name>{found.script}</pre>
          </details>
        )}
      </div>
      <RefusedText>{refused || loading.refused}</RefusedText>
      <div className="actions">
        <Button onPress={onClose}>{t`Back`}</Button>
        {canChange && (
          <Button variant="primary" isDisabled={busy || found === null} onPress={onChange}>
            {t`Change over`}
          </Button>
        )}
      </div>
    </>
  );
}
