#!/bin/sh
# Install ARCOR2-HW from this folder as a service, without a network. To replace an installed version: arcor2-hw upgrade
#
#   ./install.sh [--public-key RW...] [--no-start] [--no-server]
set -eu
umask 022
bundle=$(cd "$(dirname "$0")" && pwd)
python=${PYTHON:-python3}
key=
for argument in "$@"; do
  case "${previous:-} $argument" in
    "--public-key "*) key=$argument ;;
    *" --public-key="*) key=${argument#--public-key=} ;;
  esac
  previous=$argument
done
[ "$(id -u)" = 0 ] || { echo "install.sh: only root can install the service" >&2; exit 1; }
(cd "$bundle" && sha256sum --check --strict --quiet SHA256SUMS) || { echo "install.sh: a file was changed or is damaged" >&2; exit 1; }
if [ -n "$key" ] && command -v minisign >/dev/null; then
  minisign -V -q -P "$key" -m "$bundle/SHA256SUMS" || { echo "install.sh: the signature is not valid" >&2; exit 1; }
fi
version=$(sed -n 's/^arcor2-hw==\([^ ]*\) .*/\1/p' "$bundle/requirements.txt")
target=/opt/arcor2-hw/$version
[ ! -e /opt/arcor2-hw/current ] || { echo "install.sh: a version is installed; use arcor2-hw upgrade" >&2; exit 1; }
rm -rf "$target"
mkdir -p /opt/arcor2-hw
trap 'rm -rf "$target"' EXIT
"$python" -m venv "$target"
"$target/bin/python" -m pip --isolated install --quiet --disable-pip-version-check --no-input --no-index --find-links "$bundle/wheels" \
  --require-hashes --requirement "$bundle/requirements.txt"
trap - EXIT
exec "$target/bin/arcor2-hw" install "$@"
