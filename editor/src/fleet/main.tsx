/** Entry of the page with all cells, which the server of the fleet serves. It shows states and sends no commands. */

import { createRoot } from "react-dom/client";
import { isLanguage, loadCatalogue, preferredLanguage } from "../i18n/catalogue";
import { persistently } from "../persistently";
import { remembered, takeTokenFromAddress } from "../session/localStorage";
import { FleetPage } from "./FleetPage";
import { FleetFeed } from "./feed";
import "./styles.css";

async function start(): Promise<void> {
  takeTokenFromAddress();
  const language = remembered("language");
  await persistently(() => loadCatalogue(isLanguage(language) ? language : preferredLanguage()));
  const feed = new FleetFeed();
  feed.connect(remembered("token"));
  const root = document.getElementById("root");
  if (root) createRoot(root).render(<FleetPage feed={feed} />);
}

void start();
