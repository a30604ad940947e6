/** Starts the editor in the page. */

import { StrictMode } from "react";
import { createRoot } from "react-dom/client";

const root = document.getElementById("root");
if (root) createRoot(root).render(<StrictMode>ARCOR2-HW</StrictMode>);
