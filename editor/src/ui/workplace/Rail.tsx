/** The tools: icon and word. A tap on an unavailable tool shows the reason. */

import { i18n } from "@lingui/core";
import { t } from "@lingui/core/macro";
import { Button } from "react-aria-components";
import { notify, setUi, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { TOOLS } from "./tools";

export function Rail() {
  const state = useEditor((each) => each);
  const open = state.ui.tool;
  return (
    <nav className="rail" aria-label={t`Tools`}>
      {TOOLS.filter((tool) => tool.shown?.(state) ?? true).map((tool) => {
        const why = tool.whyUnavailable?.(state) ?? "";
        return (
          <Button
            key={tool.id}
            className="rail-tool"
            aria-pressed={open === tool.id}
            aria-disabled={why !== "" || undefined}
            onPress={() => {
              if (why) notify("info", `${i18n._(tool.label)}: ${why}`);
              else setUi({ tool: open === tool.id ? "" : tool.id });
            }}
          >
            <Icon name={tool.icon} size={24} />
            {i18n._(tool.label)}
          </Button>
        );
      })}
    </nav>
  );
}
