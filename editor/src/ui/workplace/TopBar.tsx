/** The top bar: document, save, undo and redo, online switch, users. */

import { i18n } from "@lingui/core";
import { msg, plural, t } from "@lingui/core/macro";
import { useState } from "react";
import * as documents from "../../commands/documents";
import { goOffline, goOnline } from "../../commands/operation";
import { translate } from "../../i18n/serverMessages";
import { whyUnavailable } from "../../store/permissions";
import { isClosed } from "../../store/selectors";
import { notify, useEditor } from "../../store/store";
import { useCellName } from "../cell/CellName";
import { Button } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";
import { People } from "../people/People";
import { Settings } from "../settings/Settings";
import { uncontrolledOnline } from "./uncontrolled";
import { useUndoKeys } from "./useUndoKeys";

export function TopBar() {
  const doc = useEditor((state) => state.doc);
  const history = useEditor((state) => state.history);
  const live = useEditor((state) => state.live.state);
  const running = useEditor(isClosed);
  const cannotSave = useEditor((state) => whyUnavailable(state, state.doc?.project ? "SaveProject" : "SaveScene"));
  const cannotUndo = useEditor((state) => whyUnavailable(state, "Undo"));
  const [asking, setAsking] = useState(false);
  const cell = useCellName();
  useUndoKeys();
  if (!doc) return null;
  const { unsaved } = doc;
  return (
    <header className="bar topbar">
      <Button
        variant="plain"
        icon="home"
        aria-label={t`Close`}
        onPress={() => {
          const why = running ? t`Stop the program first.` : live !== "stopped" ? t`Go offline first.` : cannotSave;
          if (why) notify("info", why);
          else if (unsaved) setAsking(true);
          else void documents.close(false);
        }}
      />
      <div className="document">
        <h1>{doc.project?.name ?? doc.scene.name}</h1>
        <p className="quiet small">
          {cell && <strong className="cell-name">{cell} · </strong>}
          {doc.project ? t`on ${doc.scene.name}` : t`scene`}
          {" · "}
          <span className={unsaved ? "tag warn" : ""}>{running ? t`running` : unsaved ? t`not saved` : t`saved`}</span>
        </p>
      </div>
      <Button
        icon="save"
        className="word-on-wide"
        isDisabled={!unsaved || running || cannotSave !== ""}
        onPress={() => void documents.save()}
        aria-label={t`Save`}
      >
        <span>{t`Save`}</span>
      </Button>
      <Button
        variant="plain"
        icon="undo"
        aria-label={history?.undo ? t`Undo ${translate(history.undo)}` : t`Undo`}
        why={cannotUndo || (history?.undo ? "" : t`There is nothing to undo.`)}
        onPress={() => void documents.undo()}
      />
      <Button
        variant="plain"
        icon="redo"
        aria-label={history?.redo ? t`Redo ${translate(history.redo)}` : t`Redo`}
        why={cannotUndo || (history?.redo ? "" : t`There is nothing to redo.`)}
        onPress={() => void documents.redo()}
      />
      <LiveSwitch />
      <People />
      <Settings />
      {asking && (
        <Confirm
          title={t`Close without saving?`}
          confirmLabel={t`Discard changes`}
          onClose={() => setAsking(false)}
          onConfirm={() => void documents.close(true)}
        >
          <p>{t`All unsaved changes are lost, including those of other users.`}</p>
        </Confirm>
      )}
    </header>
  );
}

const WORDS = {
  stopped: msg`Go online`,
  starting: msg`Going online…`,
  started: msg`Online`,
  stopping: msg`Going offline…`,
};

function LiveSwitch() {
  const live = useEditor((state) => state.live.state);
  const limited = useEditor((state) => uncontrolledOnline(state).length > 0);
  const running = useEditor(isClosed);
  const cannot = useEditor((state) => whyUnavailable(state, "StartScene"));
  const objects = useEditor((state) => state.live.objects);
  const wrong = Object.values(objects).filter(
    (each) => each.state === "failed" || each.state === "lost" || each.answering === false,
  ).length;
  const faults = plural(wrong, { one: "# device fault", other: "# device faults" });
  const busy = live === "starting" || live === "stopping";
  return (
    <Button
      className={`live ${live} ${wrong > 0 || limited ? "faulty" : ""}`}
      icon="plug"
      aria-pressed={live === "started"}
      isDisabled={busy || running || cannot !== ""}
      onPress={() => void (live === "stopped" ? goOnline() : goOffline())}
      aria-label={[
        running ? t`Program is running` : i18n._(WORDS[live]),
        wrong > 0 && faults,
        live === "started" && !running && t`Press to go offline`,
      ]
        .filter(Boolean)
        .join(". ")}
    >
      <span>{running ? t`Program is running` : i18n._(WORDS[live])}</span>{" "}
      {wrong > 0 && <span className="tag bad">{faults}</span>}
    </Button>
  );
}
