/** A new recipe, or a draft to change. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { shownRecipe } from "../../commands/production";
import { refusal } from "../../commands/requests";
import type { ProjectParameter, Recipe, RecipeValue } from "../../protocol/types";
import { call } from "../../session/connection";
import { useEditor } from "../../store/store";
import { Field } from "../kit/Field";
import { SelectField } from "../kit/fields";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";

interface Props {
  recipe: Recipe | null;
  onClose: () => void;
  onSaved: () => void;
}

/** A value as texts of its fields. */
interface Row {
  value: string;
  min: string;
  max: string;
}

const NUMBERS: readonly string[] = ["double", "integer"];
const EMPTY: Row = { value: "", min: "", max: "" };

/** Return a number that a person has typed, with a point or comma. */
const typed = (text: string): number => Number(text.trim().replace(",", "."));

/** Return the fields of a stored value. */
function rowOf({ value, min, max }: RecipeValue): Row {
  const plain: unknown = JSON.parse(value);
  return {
    value: String(plain),
    min: min === undefined ? "" : String(min),
    max: max === undefined ? "" : String(max),
  };
}

/** Return the values of a recipe; rows without a value keep that of the package. */
export function valuesOf(parameters: readonly ProjectParameter[], rows: Readonly<Record<string, Row>>): RecipeValue[] {
  return parameters.flatMap(({ name, type }) => {
    const row = rows[name];
    if (!row?.value.trim()) return [];
    const value =
      type === "string"
        ? JSON.stringify(row.value)
        : NUMBERS.includes(type)
          ? JSON.stringify(typed(row.value))
          : row.value.trim();
    const min = row.min.trim() && typed(row.min);
    const max = row.max.trim() && typed(row.max);
    return [{ name, value, ...(min !== "" && { min }), ...(max !== "" && { max }) }];
  });
}

export function RecipeForm({ recipe, onClose, onSaved }: Props) {
  const packages = useEditor((state) => state.lists.packages) ?? [];
  const [product, setProduct] = useState(recipe?.product ?? "");
  const [packageId, setPackageId] = useState(recipe?.package_id ?? packages[0]?.id ?? "");
  const [rate, setRate] = useState(recipe?.planned_rate === undefined ? "" : String(recipe.planned_rate));
  const [note, setNote] = useState(recipe?.note ?? "");
  const [parameters, setParameters] = useState<readonly ProjectParameter[]>([]);
  const [rows, setRows] = useState<Record<string, Row>>(
    Object.fromEntries((recipe?.values ?? []).map((each) => [each.name, rowOf(each)])),
  );
  const { refused, busy, ask } = useRefusal();
  useEffect(() => {
    if (packageId)
      void ask(refusal(async () => setParameters((await call("GetPackageParameters", { id: packageId })).parameters)));
  }, [packageId]);
  const change = (name: string, part: Partial<Row>) =>
    setRows((known) => ({ ...known, [name]: { ...EMPTY, ...known[name], ...part } }));
  const save = async () => {
    await call("PutRecipe", {
      product: product.trim(),
      package_id: packageId,
      values: valuesOf(parameters, rows),
      note: note.trim(),
      ...(recipe && { id: recipe.id }),
      ...(rate.trim() && { planned_rate: typed(rate) }),
    });
    onSaved();
  };
  const why = !product.trim() ? t`Enter the name of the product.` : !packageId ? t`No packages yet.` : "";
  return (
    <>
      <h3>{recipe ? shownRecipe(recipe) : t`Add recipe`}</h3>
      <div className="recipe-form">
        <Field label={t`Product`} value={product} onChange={setProduct} maxLength={100} autoFocus />
        <SelectField
          label={t`Package`}
          value={packageId}
          choices={packages.map((each) => [each.id, each.package_meta.name] as const)}
          onChange={setPackageId}
        />
        <Field label={t`Planned parts per hour`} value={rate} onChange={setRate} inputMode="decimal" />
        <Field label={t`Note`} value={note} onChange={setNote} maxLength={500} />
      </div>
      {parameters.length > 0 && (
        <table className="recipe-values">
          <thead>
            <tr>
              <th>{t`Value`}</th>
              <th>{t`This recipe`}</th>
              <th>{t`Lowest`}</th>
              <th>{t`Highest`}</th>
            </tr>
          </thead>
          <tbody>
            {parameters.map(({ name, type, value }) => (
              <tr key={name}>
                <th scope="row" data-name={name}>
                  {name}
                </th>
                {(
                  [
                    ["value", t`This recipe`],
                    ["min", t`Lowest`],
                    ["max", t`Highest`],
                  ] as const
                ).map(([part, title]) => (
                  <td key={part}>
                    {(part === "value" || NUMBERS.includes(type)) && (
                      <input
                        aria-label={`${name}, ${title}`}
                        placeholder={part === "value" ? String(JSON.parse(value)) : ""}
                        value={rows[name]?.[part] ?? ""}
                        onChange={(event) => change(name, { [part]: event.target.value })}
                      />
                    )}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      )}
      <p className="quiet small">
        {t`Empty fields keep the value of the package. Without limits, a run cannot change the value.`}
      </p>
      <RefusedText>{refused}</RefusedText>
      <div className="actions">
        <Button onPress={onClose}>{t`Cancel`}</Button>
        <Button variant="primary" why={why} isDisabled={busy} onPress={() => void ask(refusal(save))}>
          {t`Save`}
        </Button>
      </div>
    </>
  );
}
