/** Dialogs and menus whose code is loaded when it is needed. */

import { Suspense, useState } from "react";
import { Button } from "./kit";
import { lazyComponent } from "./lazy";
import type { AskNameProps, ConfirmProps, MoreProps } from "./props";

const ConfirmDialog = lazyComponent(() => import("./dialogs").then((module) => ({ default: module.Confirm })));
const AskNameDialog = lazyComponent(() => import("./dialogs").then((module) => ({ default: module.AskName })));
const MoreMenu = lazyComponent(() => import("./menu"));

/** Ask for confirmation of an action that cannot be undone. */
export function Confirm(props: ConfirmProps) {
  return (
    <Suspense fallback={null}>
      <ConfirmDialog {...props} />
    </Suspense>
  );
}

/** Ask for a name. */
export function AskName(props: AskNameProps) {
  return (
    <Suspense fallback={null}>
      <AskNameDialog {...props} />
    </Suspense>
  );
}

/** A button that opens a menu; if it is pressed before the menu is loaded, the menu opens as soon as it is. */
export function More(props: MoreProps) {
  const { label, icon = "more", children, variant = "plain" } = props;
  const [pressed, setPressed] = useState(false);
  return (
    <Suspense
      fallback={
        <Button variant={variant} icon={icon} aria-label={label} onPressStart={() => setPressed(true)}>
          {children}
        </Button>
      }
    >
      <MoreMenu {...props} defaultOpen={pressed} />
    </Suspense>
  );
}
