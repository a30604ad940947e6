/** A list with its state: loading, empty, failed, further pages, and export. */

import { t } from "@lingui/core/macro";
import type { ReactNode } from "react";
import { Button, Waiting } from "../ui/kit/kit";
import { RefusedText, useRefusal } from "../ui/points/Refusal";
import { exportResults } from "./results";
import type { Pages } from "./useResults";

interface ListedProps<Entry> {
  pages: Pages<Entry>;
  empty: string;
  children: (entries: Entry[]) => ReactNode;
  /** Which results the export contains. */
  file: "units" | "alarms";
  query: Readonly<Record<string, string | number>>;
}

export function Listed<Entry>({ pages, empty, children, file, query }: ListedProps<Entry>) {
  const { data, failed, more, busy, loadMore } = pages;
  const { refused, busy: saving, ask } = useRefusal();
  const save = () =>
    exportResults(file, query).then(
      () => "",
      (error: Error) => error.message,
    );
  return (
    <>
      {!data && !failed && <Waiting>{t`Loading…`}</Waiting>}
      {data?.length === 0 && <p className="quiet">{empty}</p>}
      {data && data.length > 0 && children(data)}
      <RefusedText>{failed || refused}</RefusedText>
      <div className="fleet-more">
        {more && <Button isDisabled={busy} onPress={loadMore}>{t`Show more`}</Button>}
        {data && data.length > 0 && (
          <Button icon="save" isDisabled={saving} onPress={() => void ask(save())}>{t`Export CSV`}</Button>
        )}
      </div>
    </>
  );
}
