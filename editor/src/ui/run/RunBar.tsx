/** State and controls of the running program, shown in the view whichever panel is open. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { Suspense } from "react";
import * as commands from "../../commands/run";
import { lanesOf } from "../../program/lanes";
import { calledBy } from "../../program/logic";
import { doingWords, innermost, stackOf } from "../../program/position";
import { whyUnavailable } from "../../store/permissions";
import { anyAction } from "../../store/scope";
import type { Program } from "../../store/state";
import { select, useEditor } from "../../store/store";
import { selectionOf } from "../../viewmodel/names";
import { Button } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { Lanes } from "./Lanes";

const HeldCard = lazyComponent(() => import("../held/HeldCard"));

const STATES: Record<string, MessageDescriptor> = {
  started: msg`Starting…`,
  running: msg`Running`,
  pausing: msg`Pausing…`,
  paused: msg`Paused`,
  resuming: msg`Resuming…`,
  stopping: msg`Stopping…`,
};

/** Return the name of the state of the program as shown to users. */
export function phaseName({ state, held }: Program): string | undefined {
  const name = held ? msg`Held` : STATES[state];
  return name && i18n._(name);
}

export default function RunBar() {
  const state = useEditor((each) => each);
  const { state: phase } = state.program;
  const doing = doingWords(state);
  const [inner] = innermost(state);
  const lanes = lanesOf(state);
  return (
    <>
      <div className="runbar" role="group" aria-label={t`The program`}>
        <span className="runbar-state" role="status">
          <strong>{phaseName(state.program)}</strong>
          {doing && lanes.length === 0 && (
            <span className="small quiet"> {phase === "paused" ? t`before ${doing}` : doing}</span>
          )}
        </span>
        {inner !== undefined && state.doc && !(inner in state.doc.actions) && selectionOf(state, inner) && (
          <Button icon="function" onPress={() => select(selectionOf(state, inner))}>
            {t`Show`}
          </Button>
        )}
        <RunButtons />
        <Lanes lanes={lanes} />
      </div>
      <Held />
    </>
  );
}

/** The failure, and the ways to continue, while the program is held at a failed action. */
export function Held() {
  const held = useEditor((state) => state.program.held);
  return held ? (
    <Suspense fallback={null}>
      <HeldCard key={held.number} held={held} />
    </Suspense>
  ) : null;
}

/** Pause, resume, step and stop, as far as the state allows. `whyNoResume`: why the program cannot be resumed here. */
export function RunButtons({ whyNoResume = "" }: { whyNoResume?: string }) {
  const phase = useEditor((state) => state.program.state);
  const held = useEditor((state) => state.program.held !== null);
  const why = useEditor((state) => whyUnavailable(state, "StopPackage"));
  const whyNot = why || whyNoResume;
  const inside = useEditor((state) => innermost(state).some((id) => stackOf(state, id).length > 1));
  const beforeCall = useEditor(({ doc, program }) => {
    const last = doc && anyAction(doc, program.running.at(-1) ?? "");
    return doc !== null && calledBy(doc, last ?? undefined) !== undefined;
  });
  return (
    <>
      {phase === "running" && (
        <Button icon="pause" why={why} onPress={() => void commands.pause()}>
          {t`Pause`}
        </Button>
      )}
      {phase === "paused" && !held && (
        <>
          <Button icon="play" variant="primary" why={whyNot} onPress={() => void commands.resume()}>
            {t`Resume`}
          </Button>
          <Button icon="step" why={whyNot} onPress={() => void commands.step()}>
            {t`Step`}
          </Button>
          {beforeCall && (
            <Button why={whyNot} onPress={() => void commands.step("into")}>
              {t`Step into`}
            </Button>
          )}
          {inside && (
            <Button why={whyNot} onPress={() => void commands.step("out")}>
              {t`Step out`}
            </Button>
          )}
        </>
      )}
      {(phase === "running" || phase === "paused" || phase === "pausing" || phase === "resuming") && (
        <Button icon="stop" why={why} onPress={() => void commands.stop()}>
          {t`Stop`}
        </Button>
      )}
    </>
  );
}
