/** Entry of the editor: load the texts, show the page, join as the user who was here last. */

import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { loadCatalogue, preferredLanguage } from "./i18n/catalogue";
import { remembered, takeTokenFromAddress } from "./session/memory";
import { session } from "./session/session";
import { App } from "./ui/App";
import { persistently } from "./ui/kit/lazily";
import "./ui/tokens.css";
import "./ui/base.css";

async function start(): Promise<void> {
  takeTokenFromAddress();
  const name = remembered("name");
  // A document is probably open: load the view while the server is asked.
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
  // Parts that a first tap opens are loaded after the first picture.
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
}

void start();
