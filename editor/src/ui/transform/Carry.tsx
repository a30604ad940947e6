/** In AR: a button that makes the selected item follow the tablet while it is held. A separate chunk. */

import { t } from "@lingui/core/macro";
import type { HoldToRunMotion } from "../../commands/holdToRun";
import { beginMove } from "../../commands/move";
import { theEngine } from "../../session/engine";
import { getState, useEditor } from "../../store/store";
import type { Selection } from "../../store/ui";
import { carried, same } from "../../transform/placing";
import { targetOf } from "../../transform/target";
import { nameOf } from "../../viewmodel/names";
import { HoldButton } from "../robot/HoldButton";
import { viewPose } from "./useGizmo";
import "../robot/robot.css";

interface CarryProps {
  selection: Selection;
  /** Whether the item is turned; otherwise it is moved without turning. */
  turns: boolean;
  why: string;
}

export default function Carry({ selection, turns, why }: CarryProps) {
  const name = useEditor((state) => nameOf(state, selection.id));
  return (
    <>
      <HoldButton
        className="carry"
        label={turns ? t`Hold to turn ${name} with the tablet` : t`Hold to move ${name} with the tablet`}
        why={why}
        onHold={() => carry(selection, turns)}
      >
        {t`Hold to carry`}
      </HoldButton>
      <p className="small quiet">
        {turns ? t`While you hold it, it turns with the tablet.` : t`While you hold it, it moves with the tablet.`}
      </p>
    </>
  );
}

/** Let an item follow the camera of the view until the end; then send it as one edit. */
function carry(selection: Selection, turns: boolean): HoldToRunMotion {
  const engine = theEngine();
  const start = targetOf(getState(), selection);
  if (!engine || !start) return { end: () => {}, over: Promise.resolve("") };
  const one = beginMove(start);
  const from = viewPose();
  let shown = from;
  const unwatch = engine.watch(() => {
    const view = viewPose();
    if (same(view, shown)) return;
    shown = view;
    one.moveTo(carried(start.pose, from, view, turns));
  });
  return {
    end: () => {
      unwatch();
      one.finish();
    },
    over: one.over.then(() => {
      unwatch();
      return "";
    }),
  };
}
