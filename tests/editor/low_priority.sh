#!/bin/sh
# Run the browser at $BROWSER with a low priority. Root may raise priorities, and Chromium would raise that of its drawing
# threads above drivers and fakes; so it loses that right.
if test "$(id -u)" = 0; then
  exec nice -n 10 setpriv --bounding-set=-sys_nice --inh-caps=-sys_nice "$BROWSER" "$@"
fi
exec nice -n 10 "$BROWSER" "$@"
