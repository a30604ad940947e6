/** Parameters of an action: a value, the result of an earlier action, or a project parameter. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { addFunctionParameter, freeParameterName } from "../../commands/functions";
import { awaited } from "../../commands/ownEvents";
import { addParameter } from "../../commands/parameters";
import { notEditable, setParameter } from "../../commands/program";
import { dynamicValues, lastDynamicValues } from "../../commands/startingValues";
import { linkToError, usableErrors } from "../../program/errorExits";
import { decoded } from "../../program/json";
import { linkTo, metaOf, usable } from "../../program/logic";
import { freeName, words } from "../../program/naming";
import { extraOf, initialValue, SIMPLE, type Source, sourceOf, typeName } from "../../program/values";
import type { ActionParameter, ParameterMeta } from "../../protocol/types";
import { scopeOf } from "../../store/scope";
import type { State } from "../../store/state";
import { getState, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { ReachOfAction } from "../points/Reach";
import type { Section } from "../workplace/section";
import { ShowValue } from "./ShowValue";
import { type Choice, ValueField } from "./ValueField";
import "./program.css";

const SOURCES: Record<Source, MessageDescriptor> = {
  value: msg`Value`,
  link: msg`Result`,
  project_parameter: msg`Project`,
  function_parameter: msg`Parameter`,
};

const ActionParameters: Section["Body"] = ({ selection: { id } }) => {
  const doc = useEditor((state) => state.doc);
  const types = useEditor((state) => state.types);
  const action = doc?.actions[id];
  if (!doc || !action) return null;
  const meta = metaOf(types, doc, action);
  if (!meta) return <p className="quiet small">{t`Parameters unknown: the device or its action no longer exists.`}</p>;
  if (meta.parameters.length === 0) return <p className="quiet small">{t`No parameters`}</p>;
  return (
    <>
      <ReachOfAction id={id} />
      {meta.parameters.map((wanted) => (
        <ParameterField
          key={`${id}/${wanted.name}`}
          actionId={id}
          wanted={wanted}
          parameter={action.parameters.find((each) => each.name === wanted.name)}
        />
      ))}
    </>
  );
};
export default ActionParameters;

function ParameterField({
  actionId,
  wanted,
  parameter,
}: {
  actionId: string;
  wanted: ParameterMeta;
  parameter: ActionParameter | undefined;
}) {
  const state = useEditor((each) => each);
  const why = notEditable(state);
  const chosen = parameter ? sourceOf(parameter) : "value";
  const [source, setSource] = useState<Source>(chosen);
  useEffect(() => setSource(chosen), [chosen]);
  const { name, type } = wanted;
  const { doc, types } = state;
  if (!doc) return null;
  const results = usable(doc, types, actionId, type);
  const errors = type === "string" ? usableErrors(doc, actionId) : [];
  const simple = (SIMPLE as readonly string[]).includes(type);
  const constants = Object.values(doc.parameters).filter(
    (each) => each.type === type && each.name !== "scene_id" && each.name !== "project_id",
  );
  const open = doc.functions[scopeOf(doc)];
  const present = chosen === "value" ? (parameter?.value ?? initialValue(wanted)) : initialValue(wanted);
  const sources: Source[] =
    type === "image"
      ? ["link"]
      : [
          "value",
          ...(results.length + errors.length > 0 || chosen === "link" ? (["link"] as const) : []),
          ...(simple ? (["project_parameter"] as const) : []),
          ...(open ? (["function_parameter"] as const) : []),
        ];
  const set = (of: Source, json: string) =>
    setParameter(actionId, { name, type: of === "value" ? type : of, value: json });
  const label = words(name);
  const field = { label, name: label, why, hint: wanted.description };
  return (
    <div className="parameter">
      {source === "value" ? (
        <Literal
          state={state}
          actionId={actionId}
          wanted={wanted}
          json={chosen === "value" ? present : undefined}
          field={field}
          onSet={(json) => set("value", json)}
        />
      ) : source === "link" ? (
        <ValueField
          {...field}
          type="string"
          json={chosen === "link" ? parameter?.value : undefined}
          choices={[
            ...results.map((each) => ({
              json: JSON.stringify(linkTo(each)),
              label: t`${each.name} of ${each.action.name}`,
            })),
            ...errors.map((each) => ({
              json: JSON.stringify(linkToError(each)),
              label: t`${each.name} of ${each.action.name}`,
            })),
          ]}
          hint={t`result of an earlier action`}
          onSet={(json) => set("link", json)}
        />
      ) : source === "function_parameter" ? (
        <ValueField
          {...field}
          type="string"
          json={chosen === "function_parameter" ? parameter?.value : undefined}
          choices={[
            ...(open?.parameters ?? [])
              .filter((each) => each.type === type)
              .map((each) => ({ json: JSON.stringify(each.name), label: words(each.name) })),
            { json: NEW, label: t`New parameter…` },
          ]}
          hint={t`stated by each call of the function`}
          onSet={async (json) => {
            if (json !== NEW) return set("function_parameter", json);
            const free = freeParameterName(name);
            return (await addFunctionParameter(free, type, present)) || set("function_parameter", JSON.stringify(free));
          }}
        />
      ) : (
        <ValueField
          {...field}
          type="string"
          json={chosen === "project_parameter" ? parameter?.value : undefined}
          choices={[
            ...constants.map((each) => ({
              json: JSON.stringify(each.id),
              label: `${each.name} = ${String(decoded(each.value))}`,
            })),
            { json: NEW, label: t`New variable…` },
          ]}
          hint={t`shared by all actions`}
          onSet={async (json) => {
            if (json !== NEW) return set("project_parameter", json);
            const made = await sharedFrom(name, type, present);
            return "problem" in made ? made.problem : set("project_parameter", JSON.stringify(made.id));
          }}
        />
      )}
      {sources.length > 1 && (
        <div className="chips sources" role="radiogroup" aria-label={t`Source of ${label}`}>
          {sources.map((each) => (
            <label key={each} className="chip" data-selected={source === each}>
              <input
                type="radio"
                className="hidden-but-read"
                name={`${actionId}/${name}/source`}
                checked={source === each}
                disabled={why !== ""}
                onChange={() => setSource(each)}
              />
              {i18n._(SOURCES[each])}
            </label>
          ))}
        </div>
      )}
    </div>
  );
}

/** Choice of a new project parameter; no id is the JSON null. */
const NEW = "null";

async function sharedFrom(
  name: string,
  type: string,
  value: string | undefined,
): Promise<{ id: string } | { problem: string }> {
  const free = freeName(
    name,
    Object.values(getState().doc?.parameters ?? {}).map((each) => each.name),
  );
  const problem = await addParameter(free, type, value ?? '""');
  if (problem) return { problem };
  const made = await awaited((state) => Object.values(state.doc?.parameters ?? {}).find((each) => each.name === free));
  return { id: made.id };
}

interface LiteralProps {
  state: State;
  actionId: string;
  wanted: ParameterMeta;
  json: string | undefined;
  field: { label: string; name: string; why: string; hint: string | undefined };
  onSet: (json: string) => Promise<string>;
}

function Literal({ state, actionId, wanted, json, field, onSet }: LiteralProps) {
  const dynamic = useDynamic(state, actionId, wanted);
  const robotId = state.doc?.actions[actionId]?.type.split("/")[0] ?? "";
  const robot = state.doc?.objects[robotId]?.type ?? "";
  const choices = dynamic.choices ?? placesFor(state, actionId, wanted.type);
  const hint = [field.hint, dynamic.note, choices && !dynamic.choices && typeName(wanted.type)]
    .filter(Boolean)
    .join(" · ");
  return (
    <ValueField
      {...field}
      hint={hint}
      type={wanted.type}
      json={json}
      extra={extraOf(wanted)}
      choices={choices}
      onSet={onSet}
    >
      {robot in state.types.robots && ["pose", "joints"].includes(wanted.type) && (
        <ShowValue robotId={robotId} label={field.label} value={String(decoded(json))} />
      )}
    </ValueField>
  );
}

/** Return poses, positions and joints to choose from, those of the action's point first. */
function placesFor(state: State, actionId: string, type: string): Choice[] | undefined {
  const { doc } = state;
  if (!doc) return undefined;
  const action = doc.actions[actionId];
  const robot = action?.type.split("/")[0];
  const first = <T extends { pointId: string }>(of: T[]) =>
    of.sort((a, b) => Number(b.pointId === action?.pointId) - Number(a.pointId === action?.pointId));
  const on = (each: { name: string; pointId: string }) =>
    each.name === "default" ? nameOf(state, each.pointId) : `${nameOf(state, each.pointId)}, ${each.name}`;
  const best: Record<string, string> = {};
  for (const { items, robot_id } of Object.values(state.reach)) {
    if (robot_id !== robot) continue;
    for (const { id, reach } of items)
      if (reach === "out_of_reach" || reach === "in_collision")
        best[id] = reach === "out_of_reach" ? ` – ${t`out of reach`}` : ` – ${t`in collision`}`;
  }
  switch (type) {
    case "pose":
      return first(Object.values(doc.orientations)).map((each) => ({
        json: JSON.stringify(each.id),
        label: on(each) + (best[each.id] ?? ""),
      }));
    case "position":
      return Object.values(doc.points).map((each) => ({ json: JSON.stringify(each.id), label: each.name }));
    case "joints":
      return first(Object.values(doc.joints).filter((each) => each.robot_id === robot)).map((each) => ({
        json: JSON.stringify(each.id),
        label: on(each) + (each.is_valid ? (best[each.id] ?? "") : ` – ${t`point has moved`}`),
      }));
    default:
      return undefined;
  }
}

interface Known {
  id: string;
  value: string;
}

/** Return the value of a parameter if it is known before the run; null for results. */
function knownValue(state: State, parameter: ActionParameter | undefined): string | null {
  if (!parameter || parameter.type === "link") return null;
  if (parameter.type !== "project_parameter") return parameter.value;
  return state.doc?.parameters[String(decoded(parameter.value))]?.value ?? null;
}

/** Return the choices of a dynamic parameter: requested while the device is online, otherwise the last known ones. */
function useDynamic(state: State, actionId: string, wanted: ParameterMeta): { choices?: Choice[]; note?: string } {
  const action = state.doc?.actions[actionId];
  const objectId = action?.type.split("/")[0] ?? "";
  const online = state.live.state === "started";
  const parents = (wanted.dynamic_value_parents ?? []).map((id) => ({
    id,
    value: knownValue(
      state,
      action?.parameters.find((each) => each.name === id),
    ),
  }));
  const missing = parents.filter((each) => each.value === null).map((each) => words(each.id));
  const key = JSON.stringify([objectId, wanted.name, parents]);
  const [asked, setAsked] = useState<{ key: string; values: string[] } | null>(null);
  useEffect(() => {
    if (!wanted.dynamic_value || !online || missing.length > 0) return;
    let ended = false;
    dynamicValues(objectId, wanted.name, parents as Known[]).then(
      (values) => ended || setAsked({ key, values }),
      () => {},
    );
    return () => {
      ended = true;
    };
  }, [key, online, wanted.dynamic_value]);
  if (!wanted.dynamic_value) return {};
  if (missing.length > 0) return { note: t`Choices depend on ${missing.join(", ")}, which is known only at run time.` };
  const fresh = asked?.key === key && online;
  const values = fresh ? asked.values : lastDynamicValues(objectId, wanted.name, parents as Known[]);
  if (!values) return { note: online ? t`Loading…` : t`Go online to load the choices.` };
  const choices = values.map((each) => ({
    json: wanted.type.startsWith("integer") ? each : JSON.stringify(each),
    label: each,
  }));
  return { choices, note: fresh ? undefined : t`Last known choices.` };
}
