#!/bin/sh
# One machine, a long run in pieces: for an hour at a time until a precision is reached, each time where it was.
#   CONFIG=multimodel N=1e6 PRECISION=1 OUT=results LIMIT=3600 sh docs/recipes/one_machine.sh
set -u
CONFIG=${CONFIG:-rls2} N=${N:-1e7} PRECISION=${PRECISION:-0.5} OUT=${OUT:-results} LIMIT=${LIMIT:-3600}

while :; do
    radarsim run "$CONFIG" -n "$N" --precision "$PRECISION" --time-limit "$LIMIT" --no-figures --quiet --out "$OUT"
    status=$?
    # 3 says that the time or the N was not enough; only time is worth another round.
    [ "$status" -eq 3 ] && grep -q '"stop": "time limit' "$OUT/$(basename "$CONFIG" .yaml)/run.json" || break
done
[ "$status" -eq 0 ] && radarsim report "$CONFIG" -n "$N" --no-figures --out "$OUT"
exit "$status"
