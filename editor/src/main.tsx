/** Starts the editor in the page. */

import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { remembered, takeTokenFromAddress } from "./session/memory";
import { join } from "./session/session";
import { App } from "./ui/App";
import "./ui/tokens.css";
import "./ui/base.css";

takeTokenFromAddress();
// Who has been here before comes in by himself.
const name = remembered("name");
if (name) {
  join(name, remembered("token"));
  // Most probably something is open: the view is loaded while the server is asked.
  import("./engine/engine").catch(() => {});
}
const root = document.getElementById("root");
if (root) {
  createRoot(root).render(
    <StrictMode>
      <App />
    </StrictMode>,
  );
}

// What a first tap opens is there when it comes, without having delayed the first picture.
setTimeout(() => {
  for (const load of [
    () => import("./ui/kit/menu"),
    () => import("./ui/kit/dialogs"),
    () => import("./ui/workplace/Panel"),
    () => import("./ui/things/ThingsPanel"),
  ]) {
    load().catch(() => {}); // the server is away: it is loaded when it is needed
  }
}, 1500);
