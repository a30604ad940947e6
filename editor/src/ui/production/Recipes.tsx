/** The list of recipes: add, sign, compare, change over, roll back. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { useCallback, useEffect, useState } from "react";
import { shownRecipe } from "../../commands/production";
import { refusal } from "../../commands/requests";
import { dateAndTime, decimal } from "../../formats";
import type { ListRecipesData, Recipe } from "../../protocol/types";
import { call } from "../../session/connection";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { Button, Waiting } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";
import { RefusedText, useRefusal } from "../points/Refusal";
import { Comparison } from "./Comparison";
import { RecipeForm } from "./RecipeForm";
import { SignForm } from "./SignForm";
import { RECIPE_STATES, RECIPE_TONES } from "./texts";

type Opened = { kind: "edit"; recipe: Recipe | null } | { kind: "compare" | "delete" | "back"; recipe: Recipe };
type Signing = { recipe: Recipe; state: Recipe["state"] };

export function Recipes({ onClose }: { onClose: () => void }) {
  const [listed, setListed] = useState<ListRecipesData | null>(null);
  const [opened, setOpened] = useState<Opened | null>(null);
  const [signing, setSigning] = useState<Signing | null>(null);
  const noEditing = useEditor((state) => whyUnavailable(state, "PutRecipe"));
  const { refused, busy, ask } = useRefusal();
  const load = useCallback(async () => setListed(await call("ListRecipes", {})), []);
  useEffect(() => {
    void ask(refusal(load));
  }, [load]);
  const send = (work: () => Promise<unknown>) =>
    ask(
      refusal(async () => {
        await work();
        setOpened(null);
        await load();
      }),
    );
  const find = (id?: string) => listed?.recipes.find((each) => each.id === id);
  const present = find(listed?.changeover.recipe_id);
  const previous = find(listed?.changeover.previous_id);
  const saved = () => {
    setOpened(null);
    setSigning(null);
    void ask(refusal(load));
  };
  if (signing) return <SignForm {...signing} onClose={() => setSigning(null)} onSigned={saved} />;
  if (opened?.kind === "edit")
    return <RecipeForm recipe={opened.recipe} onClose={() => setOpened(null)} onSaved={saved} />;
  if (opened?.kind === "compare")
    return (
      <Comparison
        before={present && present.id !== opened.recipe.id ? present : (previous ?? opened.recipe)}
        after={opened.recipe}
        busy={busy}
        refused={refused}
        canChange={opened.recipe.state === "released" && opened.recipe.id !== present?.id}
        onChange={() => void send(() => call("ChangeOver", { id: opened.recipe.id }))}
        onClose={() => setOpened(null)}
      />
    );
  return (
    <>
      <div className="in-production" role="status">
        {present ? (
          <span>
            {t`In production`} <strong data-name={present.product}>{shownRecipe(present)}</strong>
          </span>
        ) : (
          <span className="quiet">{t`No product was chosen yet.`}</span>
        )}
        {previous && (
          <Button icon="undo" isDisabled={busy} onPress={() => setOpened({ kind: "back", recipe: previous })}>
            {t`Roll back to ${shownRecipe(previous)}`}
          </Button>
        )}
      </div>
      {listed === null && !refused && <Waiting>{t`Loading…`}</Waiting>}
      {listed?.recipes.length === 0 && (
        <p className="quiet">{t`No recipes yet. A recipe states which package makes a product, with which values.`}</p>
      )}
      <ul className="recipes">
        {listed?.recipes.map((each) => (
          <li key={each.id}>
            <span className="recipe-head">
              <strong data-name={each.product}>{shownRecipe(each)}</strong>
              <span className={`tag ${RECIPE_TONES[each.state]}`}>{i18n._(RECIPE_STATES[each.state])}</span>
              {each.planned_rate !== undefined && (
                <span className="quiet small">{t`${decimal(each.planned_rate)} per hour`}</span>
              )}
            </span>
            {each.note && <span data-name={each.note}>{each.note}</span>}
            {each.signatures.map(({ state, name, at, note }) => (
              <span key={at} className="quiet small">
                {i18n._(RECIPE_STATES[state])}: <span data-name={name}>{name}</span>, {dateAndTime(at)}
                {note && <span data-name={note}>, {note}</span>}
              </span>
            ))}
            <span className="recipe-buttons">
              {each.state === "draft" && (
                <>
                  <Button why={noEditing} onPress={() => setOpened({ kind: "edit", recipe: each })}>{t`Change`}</Button>
                  <Button
                    why={noEditing}
                    onPress={() => setSigning({ recipe: each, state: "tested" })}
                  >{t`Sign as tested`}</Button>
                  <Button
                    variant="plain"
                    icon="close"
                    why={noEditing}
                    aria-label={t`Delete ${shownRecipe(each)}`}
                    onPress={() => setOpened({ kind: "delete", recipe: each })}
                  />
                </>
              )}
              {each.state === "tested" && (
                <Button
                  why={noEditing}
                  onPress={() => setSigning({ recipe: each, state: "released" })}
                >{t`Release`}</Button>
              )}
              {each.id !== present?.id && each.state !== "draft" && (
                <Button onPress={() => setOpened({ kind: "compare", recipe: each })}>
                  {each.state === "released" ? t`Change over` : t`Compare`}
                </Button>
              )}
              {(each.state === "tested" || each.state === "released") && (
                <Button
                  variant="plain"
                  why={noEditing}
                  onPress={() => setSigning({ recipe: each, state: "retired" })}
                >{t`Retire`}</Button>
              )}
            </span>
          </li>
        ))}
      </ul>
      <RefusedText>{refused}</RefusedText>
      <div className="actions">
        <Button icon="plus" why={noEditing} onPress={() => setOpened({ kind: "edit", recipe: null })}>
          {t`Add recipe`}
        </Button>
        <Button variant="primary" onPress={onClose}>
          {t`Close`}
        </Button>
      </div>
      {opened?.kind === "back" && (
        <Confirm
          title={t`Roll back to ${shownRecipe(opened.recipe)}?`}
          confirmLabel={t`Roll back`}
          onConfirm={() => void send(() => call("ChangeOver", { id: opened.recipe.id }))}
          onClose={() => setOpened(null)}
        >
          {t`The next run produces it. Nothing moves now.`}
        </Confirm>
      )}
      {opened?.kind === "delete" && (
        <Confirm
          title={t`Delete ${shownRecipe(opened.recipe)}?`}
          confirmLabel={t`Delete`}
          onConfirm={() => void send(() => call("DeleteRecipe", { id: opened.recipe.id }))}
          onClose={() => setOpened(null)}
        >
          {t`Only drafts can be deleted.`}
        </Confirm>
      )}
    </>
  );
}
