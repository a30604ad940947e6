/** Permission to use the orientation sensor. */

/** Ask for the orientation sensor where the browser requires it (iOS); it has to be called in a tap. */
export async function askForMotion(): Promise<void> {
  const event = globalThis.DeviceOrientationEvent as unknown as
    | { requestPermission?: () => Promise<string> }
    | undefined;
  // AR works without it, only not while no marker is in sight.
  await event?.requestPermission?.().catch(() => "denied");
}
