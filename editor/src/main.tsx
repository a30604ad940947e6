/**
 * Entry of the editor: create the client and the session, load the texts, show the page, and join as the user who was
 * here last.
 */

import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { loadCatalogue, preferredLanguage } from "./i18n/catalogue";
import { createClient } from "./session/connection";
import { remembered, takeTokenFromAddress } from "./session/localStorage";
import { recordErrors } from "./session/log";
import { createSession } from "./session/session";
import { App } from "./ui/App";
import { persistently } from "./ui/kit/lazy";
import "./ui/tokens.css";
import "./ui/base.css";

async function start(): Promise<void> {
  recordErrors();
  const session = createSession(createClient());
  takeTokenFromAddress();
  const name = remembered("name");
  // A document is probably open: load the view at the same time.
  if (name) import("./engine/engine").catch(() => {});
  await persistently(() => loadCatalogue(preferredLanguage()));
  if (name) session.join(name, remembered("token"));
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
      () => import("./ui/kit/menu"),
      () => import("./ui/kit/dialogs"),
      () => import("./ui/workplace/Panel"),
      () => import("./ui/things/ThingsPanel"),
    ]) {
      load().catch(() => {}); // offline: loaded when needed
    }
  }, 1500);
}

void start();
