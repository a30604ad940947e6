/** About the selected item: type, lock, state. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { Suspense } from "react";
import { words } from "../../../program/naming";
import { calledBy } from "../../../program/operands";
import { theEngine } from "../../../session/engine";
import { heldBy } from "../../../store/selectors";
import { useEditor } from "../../../store/store";
import { kindName, nameOf } from "../../../viewmodel/names";
import { Button } from "../../kit/kit";
import { lazyComponent } from "../../kit/lazy";
import type { Section } from "../section";
import { uncontrolledOnline } from "../uncontrolled";

const Holder = lazyComponent(() => import("./Holder"));

const Body: Section["Body"] = ({ selection: { kind, id } }) => {
  const holder = useEditor((state) => heldBy(state, id));
  const type = useEditor((state) => state.doc?.objects[id]?.type ?? "");
  const typeName = useEditor((state) => state.types.byName[type]?.display_name ?? type);
  const description = useEditor((state) => state.types.byName[type]?.description ?? "");
  const action = useEditor((state) => state.doc?.actions[id]);
  const by = useEditor((state) => (action ? nameOf(state, action.type.split("/")[0] ?? "") : ""));
  const method = action?.type.split("/")[1] ?? "";
  const called = useEditor((state) => state.doc !== null && calledBy(state.doc, action) !== undefined);
  const state = useEditor((each) => each.live.objects[id]);
  const limited = useEditor((each) => uncontrolledOnline(each).some((one) => one.id === id));
  return (
    <>
      <p>
        {called
          ? t`Calls ${by}`
          : action?.branches
            ? t`Parallel work`
            : action
              ? `${by}: ${words(method)}`
              : typeName || kindName(kind)}
        {state && (
          <span className={`tag ${limited ? "warn" : (TONE[state.state] ?? "")}`}>{stateName(state.state)}</span>
        )}
      </p>
      {state?.reason && <p className="small">{state.reason}</p>}
      {description && <p className="quiet small">{description}</p>}
      {holder && (
        <Suspense fallback={null}>
          <Holder id={id} />
        </Suspense>
      )}
      <Button icon="zoom" onPress={() => theEngine()?.focus(id)}>
        {t`Zoom`}
      </Button>
    </>
  );
};

const STATES: Record<string, MessageDescriptor> = {
  offline: msg`offline`,
  connecting: msg`connecting…`,
  online: msg`online`,
  lost: msg`connection lost`,
  back: msg`online again`,
  failed: msg`not reachable`,
};

/** Return the state of a device in words. */
export function stateName(state: string): string {
  const name = STATES[state];
  return name ? i18n._(name) : state;
}

export const TONE: Record<string, string> = {
  online: "good",
  back: "good",
  lost: "bad",
  failed: "bad",
  connecting: "warn",
};

export const about: Section = {
  id: "about",
  title: msg({ message: "About", context: "item" }),
  applies: () => true,
  Body,
};
