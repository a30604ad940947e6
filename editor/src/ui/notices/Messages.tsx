/** All messages since the page was opened, with times, newest first. */

import { i18n } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { clock } from "../../formats";
import { useEditor } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import "./messages.css";

const WORDS = { info: msg`note`, warn: msg`warning`, error: msg`error` };

export default function Messages({ onClose }: { onClose: () => void }) {
  const messageLog = useEditor((state) => state.messageLog);
  return (
    <ModalDialog title={t`Messages`} onClose={onClose}>
      {messageLog.length === 0 && <p className="quiet">{t`No messages yet.`}</p>}
      <ol className="messages" tabIndex={0} aria-label={t`Messages, newest first`}>
        {[...messageLog].reverse().map(({ id, level, text, time }) => (
          <li key={id} className={level}>
            <Icon name={level === "info" ? "info" : "warn"} size={18} />
            <time className="quiet" dateTime={new Date(time).toISOString()}>
              {clock(time, true)}
            </time>
            <span>
              <span className="hidden-but-read">{i18n._(WORDS[level])}: </span>
              {text}
            </span>
          </li>
        ))}
      </ol>
      <div className="actions">
        <Button variant="primary" onPress={onClose}>
          {t`Close`}
        </Button>
      </div>
    </ModalDialog>
  );
}
