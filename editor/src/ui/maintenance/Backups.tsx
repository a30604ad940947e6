/** Backups of the parameters of a device: read, restore with a preview, save as a file, delete. */

import { t } from "@lingui/core/macro";
import { useRef, useState } from "react";
import { downloadBackup, uploadBackup } from "../../commands/maintenance";
import { refusal } from "../../commands/requests";
import { dateAndTime } from "../../formats";
import type { BackupInfo, DeviceCard } from "../../protocol/types";
import { call } from "../../session/connection";
import { useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { Confirm } from "../kit/lazyControls";
import { RefusedText, useRefusal } from "../points/Refusal";
import { Restore } from "./Restore";

export function Backups({ card, reload }: { card: DeviceCard; reload: () => Promise<void> }) {
  const { object_id } = card;
  const online = useEditor((state) => state.live.state === "started" && state.live.objects[object_id] !== undefined);
  const [opened, setOpened] = useState("");
  const [deleting, setDeleting] = useState<BackupInfo | null>(null);
  const input = useRef<HTMLInputElement>(null);
  const { refused, busy, ask } = useRefusal();
  const offline = online ? "" : t`The device is offline.`;
  const send = (work: () => Promise<unknown>) =>
    ask(
      refusal(async () => {
        await work();
        await reload();
      }),
    );
  const restoring = card.backups.find((each) => each.id === opened);
  return (
    <section className="backups" aria-label={t`Parameters`}>
      <h3>{t`Parameters`}</h3>
      {card.backups.length === 0 && (
        <p className="quiet small">{t`No backup yet. With a backup, a new device can be set up like this one.`}</p>
      )}
      <ul>
        {card.backups.map((each) => (
          <li key={each.id}>
            <span>
              {dateAndTime(each.at)}, <span data-name={each.by}>{each.by}</span>
              {each.uploaded && `, ${t`uploaded`}`}
            </span>
            <span className="quiet small">
              {t`${each.count} parameters of ${each.identity.serial || each.identity.model}`} ·{" "}
              <span data-name={each.digest}>{each.digest.slice(0, 8)}</span>
            </span>
            <span className="backup-buttons">
              <Button why={offline} onPress={() => setOpened(opened === each.id ? "" : each.id)}>
                {card.restores ? t`Compare and restore` : t`Compare`}
              </Button>
              <Button variant="plain" onPress={() => void ask(refusal(() => downloadBackup(card, each.id)))}>
                {t`Save as file`}
              </Button>
              <Button
                variant="plain"
                icon="close"
                aria-label={t`Delete the backup of ${dateAndTime(each.at)}`}
                onPress={() => setDeleting(each)}
              />
            </span>
            {restoring === each && <Restore key={each.id} card={card} backup={each} />}
          </li>
        ))}
      </ul>
      <RefusedText>{refused}</RefusedText>
      <div className="backup-buttons">
        <Button
          icon="plus"
          why={offline}
          isDisabled={busy}
          onPress={() => void send(() => call("BackUpParameters", { object_id }))}
        >
          {busy ? t`Reading…` : t`Back up now`}
        </Button>
        <Button onPress={() => input.current?.click()}>{t`Open a file…`}</Button>
        <input
          ref={input}
          type="file"
          accept=".json"
          className="hidden-but-read"
          tabIndex={-1}
          aria-hidden="true"
          onChange={(event) => {
            const file = event.target.files?.[0];
            if (file) void send(() => uploadBackup(object_id, file));
            event.target.value = ""; // the same file can be selected again
          }}
        />
      </div>
      {deleting && (
        <Confirm
          title={t`Delete this backup?`}
          confirmLabel={t`Delete`}
          onClose={() => setDeleting(null)}
          onConfirm={() => void send(() => call("DeleteParameterBackup", { object_id, backup_id: deleting.id }))}
        >
          <p>{dateAndTime(deleting.at)}</p>
        </Confirm>
      )}
    </section>
  );
}
