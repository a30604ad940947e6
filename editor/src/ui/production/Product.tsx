/** The product that the cell produces, on the operator's screen: chosen by a changeover; a separate chunk. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { shownRecipe } from "../../commands/production";
import type { Recipe } from "../../protocol/types";
import { call } from "../../session/connection";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { openOverlay, useOverlay } from "../search/overlay";
import { canDiffer, limitsOf, type RunValues, runValues, shownValue } from "./runValues";
import "./product.css";

/** Time after which the product is loaded again, ms: another client may have changed over. */
const PERIOD = 10_000;

export interface ChosenProduct extends RunValues {
  recipe: Recipe;
  order: string;
}

interface Props {
  selected: boolean;
  onSelect: () => void;
  /** Called with the product, null if none was chosen, and whether operators may start released packages only. */
  onFound: (chosen: ChosenProduct | null, releasedOnly: boolean) => void;
}

export default function Product({ selected, onSelect, onFound }: Props) {
  const ready = useEditor((state) => state.connection.status === "ready");
  const overlay = useOverlay();
  const [recipe, setRecipe] = useState<Recipe | null>();
  const [releasedOnly, setReleasedOnly] = useState(false);
  const [order, setOrder] = useState("");
  /** The values that were entered in place of those of the recipe, by name. */
  const [texts, setTexts] = useState<Record<string, string>>({});
  useEffect(() => {
    if (!ready || overlay) return;
    let current = true;
    const load = () =>
      call("ListRecipes", { state: "released" }).then(
        ({ recipes, changeover }) => {
          if (!current) return;
          setReleasedOnly(changeover.released_only);
          setRecipe(recipes.find(({ id }) => id === changeover.recipe_id) ?? null);
        },
        () => {}, // offline: loaded again after the reconnect
      );
    void load();
    const timer = setInterval(() => void load(), PERIOD);
    return () => {
      current = false;
      clearInterval(timer);
    };
  }, [ready, overlay]);
  useEffect(() => {
    if (recipe === undefined) return;
    onFound(recipe && { recipe, order: order.trim(), ...runValues(recipe, texts) }, releasedOnly);
  }, [recipe, order, releasedOnly, texts]);
  const id = recipe?.id;
  useEffect(() => setTexts({}), [id]);
  if (!recipe && !releasedOnly) return null;
  return (
    <div className="product">
      {recipe ? (
        <label className="operator-package" data-selected={selected}>
          <input type="radio" className="hidden-but-read" name="package" checked={selected} onChange={onSelect} />
          <strong data-name={recipe.product}>{shownRecipe(recipe)}</strong>
          <span className="quiet small">{t`Product`}</span>
        </label>
      ) : (
        <p>{t`Choose a product first.`}</p>
      )}
      {recipe && selected && recipe.values.length > 0 && (
        <dl className="product-values">
          {recipe.values.map((each) => (
            <div key={each.name}>
              <dt data-name={each.name}>{each.name}</dt>
              <dd className="field">
                {canDiffer(each) ? (
                  <>
                    <input
                      aria-label={each.name}
                      inputMode="decimal"
                      placeholder={shownValue(each)}
                      value={texts[each.name] ?? ""}
                      onChange={(event) => setTexts((known) => ({ ...known, [each.name]: event.target.value }))}
                    />{" "}
                    <span className="quiet small">{limitsOf(each)}</span>
                  </>
                ) : (
                  <span data-name>{shownValue(each)}</span>
                )}
              </dd>
            </div>
          ))}
        </dl>
      )}
      <div className="product-row">
        {recipe && selected && (
          <label className="field">
            {t`Order`}
            <input value={order} maxLength={100} onChange={(event) => setOrder(event.target.value)} />
          </label>
        )}
        <Button onPress={() => openOverlay("production")}>{recipe ? t`Change product` : t`Choose product`}</Button>
      </div>
    </div>
  );
}
