/** Choose the screen (join, log-on, home, workplace or operator); connection and result above, Stop dock below. */

import { t } from "@lingui/core/macro";
import { Suspense, useEffect, useState, useSyncExternalStore } from "react";
import { useLanguage } from "../i18n/catalogue";
import { ROLES } from "../protocol/types";
import { rememberUser } from "../session/localStorage";
import { isLive, isRunning, openId } from "../store/selectors";
import { getState, useEditor } from "../store/store";
import { LostConnection } from "./connection/LostConnection";
import { Dock } from "./dock/Dock";
import { StopMotion } from "./dock/StopMotion";
import { storeOpened } from "./home/recent";
import { Waiting } from "./kit/kit";
import { lazyComponent } from "./kit/lazy";
import { Notices } from "./notices/Notices";
import { Overlays } from "./search/Overlays";
import { useScreenSettings } from "./settings/Settings";
import { CellView } from "./workplace/CellView";
import { uncontrolledOnline } from "./workplace/uncontrolled";
import { Workplace } from "./workplace/Workplace";

/** Screens that most users see one of: a chunk each. */
const Join = lazyComponent(() => import("./join/Join"));
const LogOn = lazyComponent(() => import("./persons/LogOn"));
const Home = lazyComponent(() => import("./home/Home").then((module) => ({ default: module.Home })));
const Operator = lazyComponent(() => import("./operator/Operator"));
const ControlBanner = lazyComponent(() => import("./workplace/ControlBanner"));
const Tour = lazyComponent(() => import("./tour/Tour"));
const ForceBanner = lazyComponent(() => import("./io/ForceBanner"));
const Points = lazyComponent(() => import("./io/Points"));
const ResultBanner = lazyComponent(() => import("./run/ResultBanner"));

/** The hash of the address, which selects the editor, the operator screen, or the page of inputs and outputs. */
function useHash(): string {
  return useSyncExternalStore(
    (changed) => {
      window.addEventListener("hashchange", changed);
      return () => window.removeEventListener("hashchange", changed);
    },
    () => location.hash,
  );
}

export function App() {
  const hash = useHash();
  const operator = hash.startsWith("#/operator");
  const language = useLanguage();
  useScreenSettings();
  const { status, shared, user, reason } = useEditor((state) => state.connection);
  const open = useEditor((state) => state.doc !== null);
  const live = useEditor(isLive);
  const touring = useEditor(({ ui, doc, connection }) =>
    ui.tour === null ? false : connection.role === ROLES.operator ? operator : doc !== null && !operator,
  );
  const forced = useEditor((state) => state.forces.length > 0);
  const limited = useEditor((state) => uncontrolledOnline(state).length > 0);
  const document = useEditor((state) =>
    state.connection.status === "ready" && !isRunning(state) ? openId(state) : "",
  );
  useEffect(() => {
    if (document) storeOpened(document);
  }, [document]);
  useEffect(() => {
    if (status !== "ready") return;
    const { user, role } = getState().connection;
    rememberUser(user);
    // Operators see their screen first; a hash shows that they have chosen one.
    if (role === ROLES.operator && !location.href.includes("#")) location.hash = "#/operator";
  }, [status]);
  // A lost connection does not bring users back to the join screen.
  const [wasReady, setWasReady] = useState(false);
  if (status === "ready" && !wasReady) setWasReady(true);
  if ((status === "left" || status === "refused" || status === "person") && wasReady) setWasReady(false);
  if (!wasReady) {
    // Without a name there is only a token, and the server decides whether users enter a name or log on with a PIN.
    const authenticating = (status === "connecting" || status === "joining") && !user && !shared && !reason;
    return (
      <div className="screen">
        <Suspense fallback={<Waiting>{t`Connecting…`}</Waiting>}>
          {authenticating ? (
            <Waiting>{t`Connecting…`}</Waiting>
          ) : shared && status !== "left" && status !== "refused" ? (
            <LogOn Stop={StopMotion} Notices={Notices} />
          ) : (
            <Join />
          )}
        </Suspense>
      </div>
    );
  }
  const io = hash.startsWith("#/io");
  return (
    <>
      <LostConnection />
      {forced && (
        <Suspense fallback={null}>
          <ForceBanner />
        </Suspense>
      )}
      {!operator && (
        <Suspense fallback={null}>
          {limited && <ControlBanner />}
          <ResultBanner />
        </Suspense>
      )}
      {touring && (
        <Suspense fallback={null}>
          <Tour />
        </Suspense>
      )}
      <div className="screen">
        {operator ? (
          <Suspense fallback={<Waiting>{t`Loading…`}</Waiting>}>
            <Operator key={language} kiosk={hash.includes("kiosk")} Cell={CellView} />
          </Suspense>
        ) : io ? (
          <Suspense fallback={<Waiting>{t`Loading…`}</Waiting>}>
            <Points key={language} />
          </Suspense>
        ) : open ? (
          <Workplace />
        ) : (
          <Suspense fallback={<Waiting>{t`Loading…`}</Waiting>}>
            <Home key={language} />
          </Suspense>
        )}
      </div>
      {live && <Dock />}
      <Overlays key={language} />
    </>
  );
}
