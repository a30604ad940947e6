/** Reachability as a word and a symbol, not as a colour only. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { reachOfAction, worse } from "../../program/reach";
import type { Reach, ReachOfItem } from "../../protocol/types";
import type { State } from "../../store/state";
import { useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import "./reach.css";

const SIGNS: Record<Reach, string> = {
  reachable: "✓",
  near_limit: "!",
  in_collision: "◆",
  out_of_reach: "✕",
  unknown: "?",
};
const WORDS: Record<Reach, MessageDescriptor> = {
  reachable: msg`reachable`,
  near_limit: msg`near a limit`,
  in_collision: msg`in collision`,
  out_of_reach: msg`out of reach`,
  unknown: msg`unknown`,
};
const TONES: Record<Reach, string> = {
  reachable: "good",
  near_limit: "warn",
  in_collision: "bad",
  out_of_reach: "bad",
  unknown: "",
};

interface Answer extends ReachOfItem {
  robot: string;
}

/** Reachability of an orientation or joints by robot, arm and end effector. */
function answers(state: State, id: string): Answer[] {
  const found: Answer[] = [];
  for (const one of Object.values(state.reach)) {
    const item = one.items.find((each) => each.id === id);
    if (item)
      found.push({
        ...item,
        robot: [nameOf(state, one.robot_id), one.arm_id, one.end_effector_id].filter(Boolean).join(" · "),
      });
  }
  return found;
}

/** For lists: the best robot; for an action, its own robot. */
export function ReachBadge({ id }: { id: string }) {
  const reach = useEditor((state) => {
    const action = state.doc?.actions[id];
    return (action ? reachOfAction(action, state.reach)?.reach : best(answers(state, id))?.reach) ?? "";
  });
  if (!reach) return null;
  return (
    <span className={`tag reach ${TONES[reach]}`} title={i18n._(WORDS[reach])}>
      <span aria-hidden="true">{SIGNS[reach]}</span>
      <span className="hidden-but-read">{i18n._(WORDS[reach])}</span>
    </span>
  );
}

/** All results, with the reason if it is not reachable. */
export function ReachAnswers({ id }: { id: string }) {
  const reach = useEditor((state) => state.reach);
  const doc = useEditor((state) => state.doc);
  const found = reach && doc ? answers({ reach, doc } as State, id) : [];
  if (found.length === 0) return <p className="quiet small">{t`Reachability unknown.`}</p>;
  return (
    <ul className="reaches">
      {found.map((one) => (
        <li key={one.robot}>
          <span className={`tag reach ${TONES[one.reach]}`}>
            <span aria-hidden="true">{SIGNS[one.reach]}</span> {one.robot}: {i18n._(WORDS[one.reach])}
          </span>
          {one.reason && <span className="small quiet">{one.reason}</span>}
        </li>
      ))}
    </ul>
  );
}

/** Reachability of the targets of an action, in words with the reason. */
export function ReachOfAction({ id }: { id: string }) {
  const reach = useEditor((state) => state.reach);
  const action = useEditor((state) => state.doc?.actions[id]);
  const doc = useEditor((state) => state.doc);
  const found = action && reachOfAction(action, reach);
  if (!action || !found || !doc) return null;
  const robot = nameOf({ doc } as State, action.type.split("/")[0] ?? "");
  return (
    <p className="reach-of-action">
      <span className={`tag reach ${TONES[found.reach]}`}>
        <span aria-hidden="true">{SIGNS[found.reach]}</span> {robot}: {i18n._(WORDS[found.reach])}
      </span>
      {found.reason && <span className="small quiet">{found.reason}</span>}
    </p>
  );
}

function best(found: Answer[]): Answer | undefined {
  return found.reduce<Answer | undefined>(
    (known, each) => (known && !worse(known.reach, each.reach) ? known : each),
    undefined,
  );
}
