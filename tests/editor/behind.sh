#!/bin/sh
# Chromium that waits for others that are at work. Where it may, it puts the threads that draw before everything else, drivers
# and their fakes included; so it may not.
browser=$(command -v chromium || command -v chromium-browser)
if test "$(id -u)" = 0; then
  exec nice -n 10 setpriv --bounding-set=-sys_nice --inh-caps=-sys_nice "$browser" "$@"
fi
exec nice -n 10 "$browser" "$@"
