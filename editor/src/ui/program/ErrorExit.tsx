/** An error exit: its ends, its kinds of errors, and the name of the error. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useState } from "react";
import { nameError, setErrorKinds } from "../../commands/errorExits";
import { notEditable, removeStep, startConnecting } from "../../commands/program";
import { freeKinds, partNames, switched } from "../../program/errorExits";
import { ANY, kindWords } from "../../program/errorKinds";
import { freeErrorName } from "../../program/naming";
import { usersOf } from "../../program/problems";
import { isErrorExit, placeOf } from "../../program/steps";
import { takenExit } from "../../program/takenExit";
import { derivesFrom } from "../../store/selectors";
import type { State } from "../../store/state";
import { getState, notify, select, useEditor } from "../../store/store";
import { nameOf, selectionOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";
import type { Section } from "../workplace/section";
import { ValueField } from "./ValueField";
import "./program.css";

interface ErrorKind {
  kind: string;
  /** When an action fails with such an error. */
  about: MessageDescriptor;
  /** The devices whose actions fail with it; by default all devices. */
  of?: "robot" | "camera";
}

const KINDS: readonly ErrorKind[] = [
  {
    kind: "refused",
    about: msg`The device refuses the action in its present state, for example because a bin is empty.`,
  },
  {
    kind: "device_timeout",
    about: msg`The device does not answer, or does not finish, in time.`,
  },
  { kind: "device_fault", about: msg`The device reports a fault of its own.` },
  { kind: "out_of_range", about: msg`A value is outside of what the device allows.` },
  { kind: "stale", about: msg`The device has no recent value.` },
  { kind: "no_depth", about: msg`The camera measures no distance there.`, of: "camera" },
  { kind: "overexposed", about: msg`The picture of the camera is too bright.`, of: "camera" },
  { kind: "path_blocked", about: msg`An obstacle is in the path of the robot.`, of: "robot" },
  { kind: "kinematics", about: msg`The robot cannot reach the pose.`, of: "robot" },
  {
    kind: ANY,
    about: msg`Every other error, but a lost connection, a safety stop and Stop always end the program.`,
  },
];

const ErrorExit: Section["Body"] = ({ selection: { id } }) => {
  const state = useEditor((each) => each);
  const [problem, setProblem] = useState("");
  const { doc, types } = state;
  const exit = doc?.logic[id];
  const action = exit && doc?.actions[placeOf(exit.start)];
  if (!doc || !isErrorExit(exit) || !action) return null;
  const to = placeOf(exit.end);
  const why = notEditable(state, "UpdateLogicItem");
  const free = freeKinds(doc, action.id, id);
  const device = action.type.split("/")[0] ?? "";
  const fits = KINDS.filter(({ kind, of }) => exit.error_kinds.includes(kind) || !of || isA(state, device, of));
  const others = KINDS.filter((each) => !fits.includes(each));
  const name = action.error_output;
  const users = usersOf(doc, types, { error: action.id });

  const press = async (kind: string) => {
    const next = switched(exit.error_kinds, kind);
    if (exit.error_kinds.includes(kind) && next.includes(kind))
      return notify("info", t`An error exit needs at least one kind of error. Remove the connection instead.`);
    setProblem(await setErrorKinds(id, next));
  };
  const chip = ({ kind, about }: (typeof KINDS)[number]) => (
    <label key={kind} className="chip" data-selected={exit.error_kinds.includes(kind)}>
      <input
        type="checkbox"
        className="hidden-but-read"
        checked={exit.error_kinds.includes(kind)}
        disabled={why !== "" || !free.includes(kind)}
        onChange={() => void press(kind)}
      />
      {kindWords(kind)}
      <span className="quiet small">
        {free.includes(kind) ? i18n._(about) : t`Another exit of this action has this kind.`}
      </span>
    </label>
  );
  return (
    <>
      <div className="row">
        <Button variant="plain" onPress={() => select(selectionOf(getState(), action.id))}>
          {action.name}
        </Button>
        <span className="branch error">{t`on error`}</span>
        <span aria-hidden="true">→</span>
        <Button variant="plain" onPress={() => select(selectionOf(getState(), to))}>
          {nameOf(state, to)}
        </Button>
      </div>
      {takenExit(state)?.id === id && (
        <p className="tag bad" role="status">{t`The running program has taken this exit.`}</p>
      )}
      <fieldset className="kinds">
        <legend>{t`Follow this exit if the error is`}</legend>
        {fits.map(chip)}
        {others.length > 0 && (
          <details>
            <summary>{t`Errors of other devices`}</summary>
            <div className="kinds">{others.map(chip)}</div>
          </details>
        )}
      </fieldset>
      {name ? (
        <>
          <ValueField
            label={t`Name of the error`}
            name={t`Name of the error`}
            type="string"
            json={JSON.stringify(name)}
            why={why}
            hint={t`Later actions can use: ${partNames().join(", ")}`}
            onSet={(json) => nameError(action.id, JSON.parse(json) as string)}
          />
          {users.length > 0 && (
            <p className="small">
              {t`Used by`}{" "}
              {users.map((each) => (
                <Button key={each} variant="plain" onPress={() => select({ kind: "action", id: each })}>
                  {doc.actions[each]?.name}
                </Button>
              ))}
            </p>
          )}
        </>
      ) : (
        <Button why={why} onPress={() => void nameError(action.id, freeErrorName(doc, action)).then(setProblem)}>
          {t`Store the error`}
        </Button>
      )}
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      <div className="row">
        <Button why={why} onPress={() => startConnecting(action.id, undefined, id)}>
          {t`Change target`}
        </Button>
        <Button variant="plain" why={why} onPress={() => void removeStep(id)}>
          {t`Remove`}
        </Button>
      </div>
    </>
  );
};
export default ErrorExit;

function isA(state: State, objectId: string, of: "robot" | "camera"): boolean {
  const type = state.doc?.objects[objectId]?.type ?? "";
  return of === "robot" ? type in state.types.robots : derivesFrom(state, type, "Camera");
}
