/** The interlocks of the scene with their present state: add, change, delete. A separate chunk. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useState } from "react";
import { deleteInterlock, freeInterlockName, notChangeable } from "../../commands/interlocks";
import type { Interlock, InterlockCondition, InterlockState } from "../../protocol/types";
import { useEditor } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { Button, Waiting } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";
import { RefusedText, useRefusal } from "../points/Refusal";
import { InterlockForm } from "./InterlockForm";
import { needText } from "./texts";
import { useInterlocks } from "./useInterlocks";
import "./interlocks.css";

const STATES: Record<InterlockCondition, MessageDescriptor> = {
  met: msg`met`,
  not_met: msg`not met`,
  unknown: msg`unknown`,
};
const TONES: Record<InterlockCondition, string> = { met: "good", not_met: "bad", unknown: "warn" };

export default function Interlocks({ onClose }: { onClose: () => void }) {
  const found = useInterlocks();
  const why = useEditor(notChangeable);
  const open = useEditor((state) => state.doc !== null);
  const [editing, setEditing] = useState<Interlock | null>(null);
  const [deleting, setDeleting] = useState<Interlock | null>(null);
  const { refused, ask } = useRefusal();
  if (editing) {
    const back = () => setEditing(null);
    return (
      <ModalDialog title={editing.id ? t`Change interlock` : t`New interlock`} onClose={back}>
        <InterlockForm interlock={editing} onDone={back} />
      </ModalDialog>
    );
  }
  const add = () =>
    setEditing({
      id: "",
      name: freeInterlockName(t`Interlock`, found?.interlocks ?? []),
      on: "zone",
      object_id: "",
      actions: [],
      needs: [],
      during: true,
      within: 30,
      else: "wait",
      retract: [],
    });
  return (
    <ModalDialog title={t`Interlocks and zones`} onClose={onClose}>
      <p className="quiet small">{t`They help to avoid damage. They are not a safety function.`}</p>
      {!open && <p>{t`No scene or project is open.`}</p>}
      {open && !found && <Waiting>{t`Loading…`}</Waiting>}
      {found?.interlocks.length === 0 && (
        <p>{t`No interlocks. They let a robot wait for an open door, or two robots share a place.`}</p>
      )}
      <ul className="interlocks">
        {found?.interlocks.map((each) => (
          <Row
            key={each.id}
            interlock={each}
            state={found.states[each.id]}
            why={why}
            onEdit={() => setEditing(each)}
            onDelete={() => setDeleting(each)}
          />
        ))}
      </ul>
      <RefusedText>{refused}</RefusedText>
      <div className="actions">
        <Button icon="plus" why={why} onPress={add}>
          {t`Add interlock`}
        </Button>
        <Button variant="primary" onPress={onClose}>
          {t`Close`}
        </Button>
      </div>
      {deleting && (
        <Confirm
          title={t`Delete ${deleting.name}?`}
          confirmLabel={t`Delete`}
          onClose={() => setDeleting(null)}
          onConfirm={() => void ask(deleteInterlock(deleting.id))}
        >
          <p>{t`Its conditions are not checked any more. Undo restores it.`}</p>
        </Confirm>
      )}
    </ModalDialog>
  );
}

interface RowProps {
  interlock: Interlock;
  state: InterlockState | undefined;
  why: string;
  onEdit: () => void;
  onDelete: () => void;
}

function Row({ interlock, state, why, onEdit, onDelete }: RowProps) {
  const objects = useEditor((all) => all.doc?.objects);
  const nameOf = (id: string) => objects?.[id]?.name ?? t`a missing object`;
  const target = nameOf(interlock.object_id);
  const actions = interlock.actions.join(", ");
  const waiting = state?.waiting.map(nameOf).join(", ");
  const owner = state?.owner && nameOf(state.owner);
  return (
    <li>
      <div className="interlock-head">
        <strong data-name={interlock.name}>{interlock.name}</strong>
        <span className={`tag ${state ? TONES[state.state] : ""}`}>
          {state ? i18n._(STATES[state.state]) : t`offline`}
        </span>
      </div>
      <span className="small">
        {interlock.on === "zone" ? t`Zone ${target}` : actions ? t`${target}: ${actions}` : t`${target}: all actions`}
      </span>
      {interlock.needs.length > 0 && (
        <ul className="small">
          {interlock.needs.map((need, n) => (
            <li key={n}>{needText(need, nameOf(need.object_id))}</li>
          ))}
        </ul>
      )}
      {state?.text && <span className="small error">{state.text}</span>}
      {owner && <span className="small">{t`In use by ${owner}.`}</span>}
      {waiting && <span className="small">{t`Waiting: ${waiting}`}</span>}
      <div className="actions start">
        <Button why={why} onPress={onEdit} aria-label={t`Change ${interlock.name}`}>
          {t`Change`}
        </Button>
        <Button why={why} onPress={onDelete} aria-label={t`Delete ${interlock.name}`}>
          {t`Delete`}
        </Button>
      </div>
    </li>
  );
}
