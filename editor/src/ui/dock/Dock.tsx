/**
 * The Stop dock: the lower edge of the page while something may move. Its size never changes and no other control is
 * placed in it, so Stop never covers anything. Messages appear next to Stop.
 */

import { Notices } from "../notices/Notices";
import { StopMotion } from "./StopMotion";
import "./dock.css";

export function Dock() {
  return (
    // The attribute keeps react-aria from making the dock inert while a dialog or menu is open.
    <div className="dock" data-react-aria-top-layer="true">
      <Notices docked />
      <StopMotion />
    </div>
  );
}
