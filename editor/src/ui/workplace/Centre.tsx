/** The centre: 3D view, program graph, both, or code. The 3D view stays behind the others. */

import { t } from "@lingui/core/macro";
import { Suspense } from "react";
import { useLanguage } from "../../i18n/catalogue";
import { isRunning } from "../../store/selectors";
import { useEditor } from "../../store/store";
import type { Mode } from "../../store/ui";
import { Waiting } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { View3D } from "./View3D";
import "../run/run.css";
import "./centre.css";

const ModeSwitch = lazyComponent(() => import("./ModeSwitch"));
const RobotChip = lazyComponent(() => import("../robot/RobotChip"));
const FlowView = lazyComponent(() => import("../flow/FlowView"));
const ConnectingBanner = lazyComponent(() => import("../program/ConnectingBanner"));
const PickingBanner = lazyComponent(() => import("../functions/PickingBanner"));
const ScopeBar = lazyComponent(() => import("../functions/ScopeBar"));
const RunBar = lazyComponent(() => import("../run/RunBar"));
const CodeView = lazyComponent(() => import("../code/CodeView"));

export function Centre() {
  const language = useLanguage();
  const project = useEditor((state) => state.doc?.project);
  const running = useEditor(isRunning);
  const connecting = useEditor((state) => state.ui.connecting !== null);
  const picking = useEditor((state) => state.ui.picked !== null);
  const inFunction = useEditor((state) => state.doc !== null && state.doc.path.length > 0);
  const chosen = useEditor((state) => state.ui.mode);
  const modes: Mode[] = project?.has_logic ? ["3d", "flow", "split", "code"] : ["3d", "code"];
  const mode = project && modes.includes(chosen) ? chosen : "3d";
  return (
    <div className="centre" data-mode={mode}>
      <View3D />
      {(mode === "flow" || mode === "split") && (
        <Suspense fallback={<Waiting>{t`Loading the program…`}</Waiting>}>
          <FlowView key={language} />
        </Suspense>
      )}
      {mode === "code" && (
        <Suspense fallback={<Waiting>{t`Loading the program…`}</Waiting>}>
          <CodeView key={language} />
        </Suspense>
      )}
      <div className="centre-top">
        <Suspense fallback={null}>{project && <ModeSwitch mode={mode} modes={modes} />}</Suspense>
        <Suspense fallback={null}>
          <RobotChip />
        </Suspense>
        <Suspense fallback={null}>
          {running && <RunBar />}
          {inFunction && mode !== "code" && <ScopeBar />}
          {connecting && <ConnectingBanner />}
          {picking && <PickingBanner />}
        </Suspense>
      </div>
    </div>
  );
}
