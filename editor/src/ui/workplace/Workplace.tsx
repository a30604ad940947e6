/** The frame of the open workplace: top bar, tools on the left, view, panel on the right. */

import { Suspense } from "react";
import { useLanguage } from "../../i18n/catalogue";
import { useEditor } from "../../store/store";
import { lazyComponent } from "../kit/lazy";
import { Notices } from "../notices/Notices";
import { Centre } from "./Centre";
import { Rail } from "./Rail";
import { TopBar } from "./TopBar";
import "./workplace.css";
import "./panel.css";

/** Loaded soon after the view, before a user can open it. */
const Panel = lazyComponent(() => import("./Panel"));

export function Workplace() {
  const language = useLanguage();
  const panel = useEditor((state) => state.ui.tool !== "" || state.ui.selection !== null);
  return (
    <div className="workplace" data-panel={panel}>
      <TopBar />
      <Rail />
      <Centre />
      {panel && (
        <Suspense fallback={<aside className="panel" aria-busy="true" />}>
          <Panel key={language} />
        </Suspense>
      )}
      <Notices />
    </div>
  );
}
