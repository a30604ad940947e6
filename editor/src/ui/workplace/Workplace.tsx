/** The frame around the open workplace: bar above, tools at the left, the view, a panel at the right, the stop. */

import { useEditor } from "../../store/store";
import { Notices } from "../notices/Notices";
import { Centre } from "./Centre";
import { Panel } from "./Panel";
import { Rail } from "./Rail";
import { StopMotion } from "./StopMotion";
import { TopBar } from "./TopBar";
import "./workplace.css";

export function Workplace() {
  const panel = useEditor((state) => state.ui.tool !== "" || state.ui.selection !== null);
  return (
    <div className="workplace" data-panel={panel}>
      <TopBar />
      <Rail />
      <Centre />
      {panel && <Panel />}
      <Notices />
      <StopMotion />
    </div>
  );
}
