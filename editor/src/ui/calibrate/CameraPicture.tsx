/** The picture of a camera: one, or live. It tells its rate, its age if it is old, and what went wrong. */

import { t } from "@lingui/core/macro";
import { useEffect, useRef, useState } from "react";
import { takePicture } from "../../commands/calibrate";
import { sentence } from "../../commands/requests";
import { decimal } from "../../formats";
import { OnOff } from "../kit/fields";
import { Button } from "../kit/kit";
import { RefusedText } from "../points/Refusal";
import { useTicking } from "../times";
import { type Feed, followCamera, staleness } from "./pictureFeed";

const reasonOf = (error: unknown): string =>
  error instanceof TypeError ? t`The server cannot be reached.` : sentence(error); // `fetch` rejects with a TypeError
const NOTHING: Feed = { failure: "" };

/** `why` is why the camera cannot take pictures; empty if it can. */
export function CameraPicture({ id, why }: { id: string; why: string }) {
  const image = useRef<HTMLImageElement>(null);
  const [live, setLive] = useState(false);
  const [feed, setFeed] = useState<Feed>(NOTHING);
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
  const once = async () => {
    const taken = Date.now();
    try {
      await draw(await takePicture(id));
      setFeed({ taken, failure: "" });
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
        {stale && <figcaption className="tag warn">{t`${decimal(age)} s old`}</figcaption>}
        {follows && !stale && feed.rate !== undefined && (
          <figcaption className="tag">{t`${decimal(feed.rate, 1)} pictures per second`}</figcaption>
        )}
      </figure>
      <div className="actions start">
        <Button why={why} isDisabled={follows} onPress={() => void once()}>
          {t`Take a picture`}
        </Button>
        <OnOff
          isSelected={follows}
          onChange={(on) => (why ? setFeed((known) => ({ ...known, failure: why })) : setLive(on))}
        >
          {t`Live picture`}
        </OnOff>
      </div>
      <RefusedText>{feed.failure}</RefusedText>
    </>
  );
}
