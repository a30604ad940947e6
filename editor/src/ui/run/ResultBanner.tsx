/** The result of the last run, above every screen of the editor until the user dismisses it or starts another run. */

import { t } from "@lingui/core/macro";
import { storeGeneralState } from "../../commands/viewstate";
import { ago } from "../../formats";
import { dismissal, resultOf, undismissedRun } from "../../program/results";
import { getState, useEditor } from "../../store/store";
import { withNames } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { useTicking } from "../times";
import { ICONS, ShowAction } from "./Result";
import "./banner.css";

export default function ResultBanner() {
  const run = useEditor(undismissedRun);
  const result = resultOf(run ?? undefined);
  useTicking();
  if (!run || !result) return null;
  return (
    <div className={`result-banner ${result.tone}`} role={result.tone === "bad" ? "alert" : "status"}>
      <Icon name={ICONS[result.tone]} />
      <p>
        <strong>{result.title}</strong>{" "}
        <span className="small">
          {`${result.name}, ${ago(run.ended ?? run.started)}. `}
          {withNames(getState(), result.detail)}
        </span>
      </p>
      {result.tone === "bad" && <ShowAction id={result.actionId} />}
      <Button
        variant="plain"
        icon="close"
        aria-label={t`Dismiss the result`}
        onPress={() => storeGeneralState(dismissal(run))}
      />
    </div>
  );
}
