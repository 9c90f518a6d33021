#!/usr/bin/env bash
# Replays a store on this machine, with a worker for each processor:
#   parallel.sh STORE [WORKERS] [more arguments of kerf fleet replay]
# GNU parallel starts them, or xargs where it is missing. A worker that fails is started once more.
set -euo pipefail
store=$1
workers=${2:-$(nproc)}
shift $(($# < 2 ? $# : 2))
fleet=${KERF_FLEET:-kerf-fleet}
shards() { for index in $(seq 0 $((workers - 1))); do echo "$index/$workers"; done; }
if command -v parallel >/dev/null; then
  shards | parallel --will-cite --jobs "$workers" --retries 2 "$fleet" replay --store "$store" --shard {} "$@"
else
  shards | xargs -P "$workers" -I{} "$fleet" replay --store "$store" --shard {} "$@"
fi
