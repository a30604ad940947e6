/** A single picture or the live picture of a camera, with its rate, its age if it is old, and errors. */

import { plural, t } from "@lingui/core/macro";
import { useEffect, useRef, useState } from "react";
import { markersIn, takePicture } from "../../commands/calibrate";
import { sentence } from "../../commands/requests";
import { decimal } from "../../formats";
import type { MarkerCorners } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import { useEditor } from "../../store/store";
import { SwitchField } from "../kit/fields";
import { Button } from "../kit/kit";
import { RefusedText } from "../points/Refusal";
import { useTicking } from "../times";
import { type Feed, followCamera, staleness } from "./pictureFeed";

const reasonOf = (error: unknown): string =>
  error instanceof TypeError ? t`The server cannot be reached.` : sentence(error); // `fetch` rejects with a TypeError
const NOTHING: Feed = { failure: "" };

/** `why`: the reason why the camera cannot take pictures; empty if it can. */
export function CameraPicture({ id, why }: { id: string; why: string }) {
  const image = useRef<HTMLImageElement>(null);
  const [live, setLive] = useState(false);
  const [feed, setFeed] = useState<Feed>(NOTHING);
  const [markers, setMarkers] = useState<MarkerCorners[] | null>(null);
  const cannotFind = useEditor((state) => whyUnavailable(state, "MarkersCorners"));
  const follows = live && !why;
  useTicking(feed.taken === undefined ? 0 : 1);
  useEffect(() => {
    const { current } = image;
    return () => {
      if (current) URL.revokeObjectURL(current.src);
    };
  }, []);
  const draw = async (picture: Blob) => {
    const { current } = image;
    if (!current) return;
    const before = current.src;
    current.src = URL.createObjectURL(picture);
    if (before) URL.revokeObjectURL(before);
    await current.decode();
  };
  const once = async (find = false) => {
    const taken = Date.now();
    setMarkers(null);
    try {
      const picture = await takePicture(id);
      await draw(picture);
      setFeed({ taken, failure: "" });
      if (find) setMarkers(await markersIn(id, picture));
    } catch (error) {
      setFeed((known) => ({ ...known, failure: reasonOf(error) }));
    }
  };
  useEffect(() => {
    if (!follows) return;
    let inView = true;
    const observer = new IntersectionObserver(([entry]) => {
      inView = entry?.isIntersecting ?? true;
    });
    if (image.current?.parentElement) observer.observe(image.current.parentElement);
    const end = followCamera({
      take: () => takePicture(id),
      draw,
      isSeen: () => !document.hidden && inView,
      reason: reasonOf,
      changed: setFeed,
    });
    return () => {
      end();
      observer.disconnect();
    };
  }, [follows, id]);
  const age = Math.floor(staleness(feed, Date.now()));
  const stale = feed.taken !== undefined && age > 0;
  return (
    <>
      <figure className="camera-live" data-stale={stale}>
        <img ref={image} className="camera-picture" alt={t`Camera picture`} hidden={feed.taken === undefined} />
        {markers && !follows && image.current && <Corners markers={markers} picture={image.current} />}
        {stale && <figcaption className="tag warn">{t`${decimal(age)} s old`}</figcaption>}
        {follows && !stale && feed.rate !== undefined && (
          <figcaption className="tag">{t`${decimal(feed.rate, 1)} pictures per second`}</figcaption>
        )}
      </figure>
      <div className="actions start">
        <Button why={why} isDisabled={follows} onPress={() => void once()}>
          {t`Take a picture`}
        </Button>
        <Button why={why || cannotFind} isDisabled={follows} onPress={() => void once(true)}>
          {t`Find markers`}
        </Button>
        <SwitchField
          isSelected={follows}
          onChange={(on) => (why ? setFeed((known) => ({ ...known, failure: why })) : setLive(on))}
        >
          {t`Live picture`}
        </SwitchField>
      </div>
      {markers && !follows && (
        <p className="quiet small" role="status">
          {plural(markers.length, { one: "# marker found", other: "# markers found" })}
        </p>
      )}
      <RefusedText>{feed.failure}</RefusedText>
    </>
  );
}

/** The outlines and numbers of markers over the picture in which they were found. */
function Corners({ markers, picture }: { markers: readonly MarkerCorners[]; picture: HTMLImageElement }) {
  const { naturalWidth: width, naturalHeight: height } = picture;
  return (
    <svg className="camera-markers" viewBox={`0 0 ${width} ${height}`} aria-hidden="true">
      {markers.map(({ marker_id, corners }) => (
        <g key={marker_id}>
          <polygon points={corners.map(({ x, y }) => `${x},${y}`).join(" ")} strokeWidth={width / 160} />
          <text x={corners[0]?.x} y={corners[0]?.y} dy={-width / 80} fontSize={width / 20} strokeWidth={width / 200}>
            {marker_id}
          </text>
        </g>
      ))}
    </svg>
  );
}
