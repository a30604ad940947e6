/** The picture of a workplace as it was when it was saved last; asked for when the tile is seen, and anew when it was saved. */

import { useEffect, useRef } from "react";
import { readThumbnail, useThumbnails } from "../../commands/thumbnail";

/** When the document was saved of which the picture was asked for. */
const asked = new Map<string, string>();

export function Thumbnail({ id, time }: { id: string; time: string }) {
  const picture = useThumbnails((all) => all[id]) ?? "";
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const element = place.current;
    if (!element || asked.get(id) === time) return;
    const watch = new IntersectionObserver((seen) => {
      if (!seen.some((each) => each.isIntersecting)) return;
      watch.disconnect();
      asked.set(id, time);
      readThumbnail(id).catch(() => asked.delete(id)); // the tile stays without one, or with the old one
    });
    watch.observe(element);
    return () => watch.disconnect();
  }, [id, time]);
  return (
    <div ref={place} className="thumbnail" data-empty={picture === ""}>
      {picture && <img src={picture} alt="" />}
    </div>
  );
}
