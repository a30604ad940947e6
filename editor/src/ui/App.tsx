/** Which screen is shown: to join, what there is, or the workplace that is open. */

import { useState } from "react";
import { useEditor } from "../store/store";
import { Home } from "./home/Home";
import { Join } from "./join/Join";
import { LostConnection } from "./connection/LostConnection";
import { useScreenSettings } from "./settings/Settings";
import { Workplace } from "./workplace/Workplace";

export function App() {
  useScreenSettings();
  const status = useEditor((state) => state.connection.status);
  const open = useEditor((state) => state.doc !== null);
  // Who has been in stays on his screen when the connection is lost.
  const [been, setBeen] = useState(false);
  if (status === "ready" && !been) setBeen(true);
  if ((status === "left" || status === "refused") && been) setBeen(false);
  if (!been) return <Join />;
  return (
    <>
      {open ? <Workplace /> : <Home />}
      <LostConnection />
    </>
  );
}
