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
  # -q: a condition and a path with spaces are one word each.
  shards | parallel -q --will-cite --jobs "$workers" --retries 2 "$fleet" replay --store "$store" --shard {} "$@"
else
  # shellcheck disable=SC2016 # The inner shell expands these.
  shards | xargs -P "$workers" -I{} sh -c '"$@" || "$@"' sh "$fleet" replay --store "$store" --shard {} "$@"
fi
