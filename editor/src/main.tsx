/**
 * Entry of the editor: create the client and the session, load the texts, show the page, and join as the last user of
 * this device.
 */

import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { isLanguage, loadCatalogue, preferredLanguage } from "./i18n/catalogue";
import { persistently } from "./persistently";
import { createClient } from "./session/connection";
import { remembered, takeTokenFromAddress } from "./session/localStorage";
import { recordErrors } from "./session/log";
import { createSession } from "./session/session";
import { App } from "./ui/App";
import "./ui/tokens.css";
import "./ui/base.css";

async function start(): Promise<void> {
  recordErrors();
  const session = createSession(createClient());
  takeTokenFromAddress();
  const name = remembered("name");
  // Load at the same time what is shown next: probably the view of an open document, or the form for the name.
  (name ? import("./engine/engine") : import("./ui/join/Join")).catch(() => {});
  void persistently(() => import("./ui/kit/steadyPress")).then(({ keepPresses }) => keepPresses(document));
  const language = remembered("language");
  await persistently(() => loadCatalogue(isLanguage(language) ? language : preferredLanguage()));
  const token = remembered("token");
  if (name || token) session.join(name, token);
  const root = document.getElementById("root");
  if (!root) return;
  createRoot(root).render(
    <StrictMode>
      <App />
    </StrictMode>,
  );
  // Load the parts that the first tap may open after the page is shown.
  setTimeout(() => {
    for (const load of [
      () => import("./ui/settings/SettingsMenu"),
      () => import("./ui/kit/dialogs"),
      () => import("./ui/workplace/Panel"),
      () => import("./ui/things/ThingsPanel"),
    ]) {
      load().catch(() => {}); // offline: loaded when needed
    }
  }, 1500);
}

void start();
