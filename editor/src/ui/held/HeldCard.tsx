/** A program that is held at a failed action: the cause, the remedy, and the ways to continue. */

import { t } from "@lingui/core/macro";
import { type ReactNode, useState } from "react";
import { acknowledge, type Decision, decide } from "../../commands/heldProgram";
import { translate, translatedAlarm } from "../../i18n/serverMessages";
import { splitAddress } from "../../program/messages";
import type { AlarmRecord, Alarm as DeviceAlarm, HeldData, ResultType } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { nameOf, withNames } from "../../viewmodel/names";
import { Picture } from "../alarms/AlarmCard";
import { useAlarms } from "../alarms/useAlarms";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";
import PartsCard from "../parts/PartsCard";
import { ValueField } from "../program/ValueField";
import "./held.css";

/** Errors that report a difference between the cell and the part inventory. */
const PART_ERRORS: readonly string[] = ["place_occupied", "place_empty", "wrong_part", "part_unconfirmed"];
/** Errors after which a device has to be connected again. */
const LOST: readonly string[] = ["connection_lost", "not_connected"];

export default function HeldCard({ held }: { held: HeldData }) {
  const state = useEditor((each) => each);
  const device = nameOf(state, held.device) || t`the device`;
  const action = held.action_name;
  const { text, address } = splitAddress(withNames(state, translate(held)));
  const [entering, setEntering] = useState(false);
  const why = whyUnavailable(state, "DecideHeld");
  const aboutParts = PART_ERRORS.includes(held.kind);
  const offers = (choice: Decision["choice"]) => held.choices.includes(choice);
  return (
    <section className="held" aria-label={t`The program is held`}>
      <div role="alert">
        <h2>
          <Icon name="warn" /> {held.before ? t`Held before ${action}` : t`Held at ${action}`}
        </h2>
        <p className="held-what">{text}</p>
      </div>
      {address && (
        <details>
          <summary>{t`Details`}</summary>
          <p data-name>{address}</p>
        </details>
      )}
      <Remedies held={held} />
      {aboutParts && <PartsCard all />}
      <p>
        {t`Fix the cause first. The program starts nothing until you decide.`}{" "}
        {t`Outputs that are on stay on, for example a belt.`}
      </p>
      {entering ? (
        <ResultForm held={held} onClose={() => setEntering(false)} />
      ) : (
        <div className="held-choices">
          {offers("retry") && <Retry held={held} why={why} />}
          {offers("skip") && (
            <Choice
              text={t`Done by hand, continue`}
              hint={t`You have done by hand what ${action} does. The program continues after it.`}
              why={why}
              act={() => decide(held, { choice: "skip" })}
            />
          )}
          {offers("result") && (
            <Choice
              text={t`Enter the result`}
              hint={t`You enter what ${device} would have reported.`}
              why={why}
              act={() => setEntering(true)}
            />
          )}
          {held.exits?.map((exit) => (
            <Choice
              key={exit.id}
              text={exit.next ? t`Continue with ${exit.next}` : t`Continue at the end`}
              hint={t`This part of the program is meant for other errors of ${action}.`}
              why={why}
              act={() => decide(held, { choice: "error_exit", exit_id: exit.id })}
            />
          ))}
          <Choice
            variant="danger"
            text={t`End the program`}
            hint={t`All devices are stopped.`}
            why={why}
            act={() => decide(held, { choice: "end" })}
          />
        </div>
      )}
      {!aboutParts && <PartsCard all folded />}
    </section>
  );
}

interface ChoiceProps {
  text: string;
  hint: string;
  why: string;
  variant?: "primary" | "danger";
  act: () => unknown;
}

function Choice({ text, hint, why, variant, act }: ChoiceProps) {
  const [busy, setBusy] = useState(false);
  const press = async () => {
    setBusy(true);
    await act();
    setBusy(false);
  };
  return (
    <div>
      <Button variant={variant ?? ""} why={why} isDisabled={busy} onPress={() => void press()}>
        {text}
      </Button>
      <p className="small">{hint}</p>
    </div>
  );
}

/** Repeat the action, or start it after the connection was lost. An action that may do harm asks first. */
function Retry({ held, why }: { held: HeldData; why: string }) {
  const device = useEditor((state) => nameOf(state, held.device)) || t`the device`;
  const action = held.action_name;
  const [asking, setAsking] = useState(false);
  const retry = () => decide(held, { choice: "retry", confirmed: true });
  return (
    <>
      <Choice
        variant="primary"
        text={held.before ? t`Continue` : t`Try again`}
        hint={
          held.before && LOST.includes(held.kind)
            ? t`Possible as soon as ${device} is connected again.`
            : t`${action} starts at once. Keep clear of the devices.`
        }
        why={why}
        act={() => (held.again === "ask" ? setAsking(true) : retry())}
      />
      {asking && (
        <Confirm
          title={t`Try ${action} again?`}
          confirmLabel={t`Try again`}
          onConfirm={() => void retry()}
          onClose={() => setAsking(false)}
        >
          <p>
            {t`It may have been executed partly.`}{" "}
            {t`Check that nothing is done twice, for example a part placed on another one.`}
          </p>
        </Confirm>
      )}
    </>
  );
}

/** The alarms of the device with their remedies, which can be acknowledged. */
function Remedies({ held }: { held: HeldData }) {
  const state = useEditor((each) => each);
  const why = whyUnavailable(state, "AcknowledgeStop");
  const records = useAlarms("retained") ?? [];
  const [refused, setRefused] = useState("");
  const [done, setDone] = useState<string[]>([]); // acknowledged alarms; the device reports them a little later
  const type = state.doc?.objects[held.device]?.type ?? "";
  const stops = state.types.robots[type]?.features?.acknowledge_stop === true;
  const present = (state.live.health[held.device]?.alarms ?? []).map(translatedAlarm);
  const keyOf = (alarm: DeviceAlarm) => `${alarm.code} ${alarm.since}`;
  const alarms = present.filter((each) => !done.includes(keyOf(each)));
  const generic = stops && held.kind === "safety_stop" && present.length === 0 && !done.includes(held.since);
  if (alarms.length === 0 && !generic && !refused) return null;
  const confirm = (code: string) =>
    void acknowledge(held.device, stops ? "" : code).then((reason) => {
      const ended = present.filter((each) => stops || each.code === code).map(keyOf);
      setRefused(reason);
      if (!reason) setDone((known) => [...known, held.since, ...ended]);
    });
  return (
    <div className="held-alarms">
      {alarms.map((alarm) => (
        <Alarm
          key={alarm.code}
          alarm={alarm}
          record={records.find((each) => each.object_id === held.device && each.code === alarm.code)}
        >
          {(!stops || alarm === alarms[0]) && (
            <Button why={why} icon="check" onPress={() => confirm(alarm.code)}>
              {t`Acknowledge`}
            </Button>
          )}
        </Alarm>
      ))}
      {generic && (
        <div className="held-alarm">
          <p>{t`Check the robot and its surroundings. Then acknowledge the stop.`}</p>
          <Button why={why} icon="check" onPress={() => confirm("")}>
            {t`Acknowledge`}
          </Button>
        </div>
      )}
      {refused && (
        <p className="error" role="alert">
          {refused}
        </p>
      )}
    </div>
  );
}

/** An alarm of the device, as its record explains it if there is one. */
function Alarm({
  alarm,
  record,
  children,
}: {
  alarm: DeviceAlarm;
  record: AlarmRecord | undefined;
  children: ReactNode;
}) {
  // The remedy of the record is for a program that has ended.
  const remedy = alarm.remedy || record?.remedy;
  return (
    <div className="held-alarm">
      <div>
        <p>{sentence(splitAddress(record?.text ?? alarm.text).text)}</p>
        {remedy && (
          <p>
            <strong>{t`Do this`}</strong> {sentence(remedy)}
          </p>
        )}
      </div>
      {record?.picture && <Picture number={record.number} />}
      {children}
    </div>
  );
}

const sentence = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);

/** The results of the action, entered by the user. */
function ResultForm({ held, onClose }: { held: HeldData; onClose: () => void }) {
  const state = useEditor((each) => each);
  const types = held.returns ?? [];
  const outputs = state.doc?.actions[held.action_id]?.flows.find((flow) => flow.type === "default")?.outputs ?? [];
  const [values, setValues] = useState<Record<number, string>>({});
  const [problem, setProblem] = useState("");
  const missing = types.some((_, index) => values[index] === undefined);
  const send = async () => {
    const results = types.map((_, index) => values[index] ?? "null");
    setProblem(await decide(held, { choice: "result", results }, false));
  };
  return (
    <form
      className="held-result"
      aria-label={t`Result of ${held.action_name}`}
      onSubmit={(event) => event.preventDefault()}
    >
      {types.map((type, index) => (
        <ResultField
          key={index}
          type={type}
          name={outputs[index] ?? t`Result ${index + 1}`}
          json={values[index]}
          onSet={(json) => setValues((known) => ({ ...known, [index]: json }))}
        />
      ))}
      {problem && (
        <p className="error" role="alert">
          {problem}
        </p>
      )}
      <div className="row">
        <Button
          variant="primary"
          why={missing ? t`Enter all results first.` : whyUnavailable(state, "DecideHeld")}
          onPress={() => void send()}
        >
          {t`Continue with this result`}
        </Button>
        <Button onPress={onClose}>{t`Back`}</Button>
      </div>
    </form>
  );
}

interface ResultFieldProps {
  type: ResultType;
  name: string;
  json: string | undefined;
  onSet: (json: string) => void;
}

function ResultField({ type, name, json, onSet }: ResultFieldProps) {
  const members = type.members ?? [];
  return (
    <ValueField
      label={name}
      name={name}
      type={type.type}
      json={json}
      extra={members.length > 0 ? { allowed_values: members.map((each) => JSON.parse(each)) } : {}}
      onTyped={onSet}
      onSet={async (typed) => {
        onSet(typed);
        return "";
      }}
    />
  );
}
