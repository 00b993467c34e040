#!/bin/sh
# Installs the peers: a Python environment in compare/.venv and the SISL driver in compare/build (Debian packages; root).
# SISL is under the AGPL: it is run here as a yardstick, and nothing of it is used in nurbskin.
set -e
here=$(cd "$(dirname "$0")" && pwd)
apt-get install -y --no-install-recommends libsisl-dev gcc libgl1 libglu1-mesa
python3 -m venv "$here/.venv"
"$here/.venv/bin/pip" install --quiet numpy scipy cadquery-ocp geomdl splipy
mkdir -p "$here/build"
gcc -O3 -march=native -w -o "$here/build/sisl" "$here/sisl.c" -lsisl -lm
cargo build --release --manifest-path "$here/../Cargo.toml" --example compare
