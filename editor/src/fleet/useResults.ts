/** Stored results that are loaded again each minute, and lists that grow page by page. */

import { useEffect, useRef, useState } from "react";
import { PAGE } from "./results";

/** Time after which shown results are loaded again, ms. */
const PERIOD = 60_000;

export interface Loaded<Data> {
  data: Data | null;
  /** Why the last request failed, as a sentence. */
  failed: string;
}

const reasonOf = (error: unknown) => (error instanceof Error ? error.message : String(error));

/** Load data when `key` changes, and each minute. The data of another key is not shown. */
export function useLoaded<Data>(key: string, load: () => Promise<Data>): Loaded<Data> {
  const [loaded, setLoaded] = useState<Loaded<Data>>({ data: null, failed: "" });
  const newest = useRef(load);
  newest.current = load;
  useEffect(() => {
    let current = true;
    const start = () =>
      newest.current().then(
        (data) => current && setLoaded({ data, failed: "" }),
        (error) => current && setLoaded(({ data }) => ({ data, failed: reasonOf(error) })),
      );
    setLoaded({ data: null, failed: "" });
    void start();
    const timer = setInterval(() => void start(), PERIOD);
    return () => {
      current = false;
      clearInterval(timer);
    };
  }, [key]);
  return loaded;
}

export interface Pages<Entry> extends Loaded<Entry[]> {
  /** Whether there may be further entries. */
  more: boolean;
  busy: boolean;
  loadMore: () => void;
}

/** Load a list page by page. The first page is loaded again each minute as long as it is the only one. */
export function usePages<Entry>(key: string, load: (last?: Entry) => Promise<Entry[]>): Pages<Entry> {
  const first = useLoaded(key, load);
  const [further, setFurther] = useState<{ of: Entry[]; entries: Entry[]; more: boolean } | null>(null);
  const [busy, setBusy] = useState(false);
  const [failed, setFailed] = useState("");
  useEffect(() => {
    setFurther(null);
    setFailed("");
  }, [key]);
  const start = further?.of ?? first.data;
  const data = start && [...start, ...(further?.entries ?? [])];
  const loadMore = () => {
    if (!start || !data) return;
    setBusy(true);
    load(data.at(-1))
      .then(
        (entries) => {
          setFurther({
            of: start,
            entries: [...(further?.entries ?? []), ...entries],
            more: entries.length === PAGE,
          });
          setFailed("");
        },
        (error) => setFailed(reasonOf(error)),
      )
      .finally(() => setBusy(false));
  };
  const more = further ? further.more : start?.length === PAGE;
  return { data, failed: failed || first.failed, more, busy, loadMore };
}
