/** The audit trail: changes and commands with their users, newest first. A separate chunk. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useCallback, useEffect, useState } from "react";
import { Input, Label, SearchField } from "react-aria-components";
import { type AuditEntry, type AuditOutcome, checkTrail, exportTrail, loadEntries, PAGE } from "../../commands/audit";
import { refusal } from "../../commands/requests";
import { dateAndTime } from "../../formats";
import { ROLE_NAMES, type RoleName } from "../../viewmodel/roles";
import { ModalDialog } from "../kit/dialogs";
import { ToggleGroup } from "../kit/fields";
import { Button, Waiting } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { differences } from "./differences";
import "./audit.css";

const OUTCOMES: Record<AuditOutcome, MessageDescriptor> = {
  done: msg`done`,
  refused: msg`refused`,
  forbidden: msg`not permitted`,
};
const TONES: Record<AuditOutcome, string> = { done: "good", refused: "warn", forbidden: "bad" };

export default function AuditTrail({ onClose }: { onClose: () => void }) {
  const [text, setText] = useState("");
  const [outcome, setOutcome] = useState<AuditOutcome | "all">("all");
  const [entries, setEntries] = useState<AuditEntry[] | null>(null);
  const [more, setMore] = useState(false);
  const [checked, setChecked] = useState("");
  const { refused, busy, ask } = useRefusal();

  const load = useCallback(
    (before: number) => loadEntries(text, outcome === "all" ? "" : outcome, before),
    [text, outcome],
  );
  useEffect(() => {
    let outdated = false;
    const timer = setTimeout(() => {
      void refusal(async () => {
        const found = await load(0);
        if (outdated) return;
        setEntries(found);
        setMore(found.length === PAGE);
      }).then((why) => outdated || !why || setChecked(why));
    }, 200);
    return () => {
      outdated = true;
      clearTimeout(timer);
    };
  }, [load]);

  const older = async () => {
    const found = await load(entries?.at(-1)?.number ?? 0);
    setEntries([...(entries ?? []), ...found]);
    setMore(found.length === PAGE);
  };
  const check = async () => {
    const { problem, first, last } = await checkTrail();
    setChecked(problem || t`Nothing was edited or removed in entries ${first} to ${last}.`);
  };
  return (
    <ModalDialog title={t`Audit trail`} onClose={onClose}>
      <div className="audit-filter">
        <SearchField className="field search" value={text} onChange={setText} autoFocus>
          <Label className="hidden-but-read">{t`Search`}</Label>
          <Input placeholder={t`User, request, item or address`} />
        </SearchField>
        <ToggleGroup
          label={t`Outcome`}
          quiet
          value={outcome}
          choices={[
            ["all", t`All`],
            ["refused", t`Refused`],
            ["forbidden", t`Not permitted`],
          ]}
          onChange={setOutcome}
        />
      </div>
      <div className="audit" tabIndex={0} role="group" aria-label={t`Entries, newest first`}>
        {entries === null && <Waiting>{t`Loading…`}</Waiting>}
        {entries?.length === 0 && <p className="quiet">{t`No entry matches.`}</p>}
        <ol>
          {entries?.map((entry) => (
            <Row key={entry.number} entry={entry} />
          ))}
        </ol>
        {more && <Button isDisabled={busy} onPress={() => void ask(refusal(older))}>{t`Show older entries`}</Button>}
      </div>
      <RefusedText>{refused}</RefusedText>
      {checked && <p role="status">{checked}</p>}
      <div className="actions">
        <Button icon="check" isDisabled={busy} onPress={() => void ask(refusal(check))}>
          {t`Check for edits`}
        </Button>
        <Button icon="save" isDisabled={busy} onPress={() => void ask(refusal(exportTrail))}>
          {t`Export all`}
        </Button>
        <Button variant="primary" onPress={onClose}>
          {t`Close`}
        </Button>
      </div>
    </ModalDialog>
  );
}

function Row({ entry }: { entry: AuditEntry }) {
  const role = ROLE_NAMES[entry.role as RoleName];
  return (
    <li>
      <span>
        <span className={`tag ${TONES[entry.outcome]}`}>{i18n._(OUTCOMES[entry.outcome])}</span>{" "}
        <span data-name={entry.request}>
          <strong>{entry.request}</strong> {entry.target}
        </span>
      </span>
      <span className="quiet small">
        <time dateTime={entry.time}>{dateAndTime(entry.time)}</time>{" "}
        {entry.user ? <span data-name={entry.user}>{entry.user}</span> : t`unknown user`}
        {role && `, ${i18n._(role)}`}
        {entry.address && <span data-name={entry.address}> ({entry.address})</span>}
      </span>
      {entry.reason && (
        <span className="small" data-name={entry.reason}>
          {entry.reason}
        </span>
      )}
      {entry.changes.length > 0 && <Changes entry={entry} />}
    </li>
  );
}

function Changes({ entry }: { entry: AuditEntry }) {
  return (
    <details>
      <summary className="small">{t`What changed`}</summary>
      <table className="small">
        <thead>
          <tr>
            <th>{t`Item`}</th>
            <th>{t`Before`}</th>
            <th>{t`Afterwards`}</th>
          </tr>
        </thead>
        <tbody>
          {entry.changes.flatMap(({ kind, id, before, after }) =>
            differences(before, after).map((each) => (
              <tr key={`${kind} ${id} ${each.field}`}>
                <td>
                  {nameOf(after) || nameOf(before) || kind}: {each.field}
                </td>
                <td>{each.before}</td>
                <td>{each.after}</td>
              </tr>
            )),
          )}
        </tbody>
      </table>
    </details>
  );
}

function nameOf(item: unknown): string {
  return (item as { name?: string } | null)?.name ?? "";
}
