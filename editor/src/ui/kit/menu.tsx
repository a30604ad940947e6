/** The menu of `More`; a separate chunk. */

import { Menu, MenuItem, MenuTrigger, Popover } from "react-aria-components";
import { Icon } from "./icons";
import { Button } from "./kit";
import type { MoreProps } from "./props";

interface MoreMenuProps extends MoreProps {
  defaultOpen: boolean;
}

export default function MoreMenu({
  label,
  choices,
  icon = "more",
  children,
  variant = "plain",
  defaultOpen,
}: MoreMenuProps) {
  const whyUnavailable = choices.filter((each) => each.why).map((each) => each.id);
  return (
    <MenuTrigger defaultOpen={defaultOpen}>
      <Button variant={variant} icon={icon} aria-label={label}>
        {children}
      </Button>
      <Popover className="popover" boundaryElement={document.querySelector(".screen") ?? undefined}>
        <Menu
          className="menu"
          aria-label={label}
          onAction={(key) => choices.find((each) => each.id === key)?.act()}
          disabledKeys={whyUnavailable}
        >
          {choices.map((each) => (
            <MenuItem key={each.id} id={each.id} className="menu-item" textValue={each.label}>
              {each.icon && <Icon name={each.icon} />}
              <span>
                {each.label}
                {each.why && <span className="quiet small"> – {each.why}</span>}
              </span>
            </MenuItem>
          ))}
        </Menu>
      </Popover>
    </MenuTrigger>
  );
}
