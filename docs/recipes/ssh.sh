#!/bin/sh
# Several machines by ssh, nothing shared but the way in: each computes its share into a store of its own, the stores
# are copied into one, and the run finds all blocks there.
#   HOSTS="a b c" CONFIG=rls2 N=1e9 OUT=results sh docs/recipes/ssh.sh
# CONFIG is a shipped experiment, or a file that lies at the same path on every host. RSH replaces ssh.
set -eu
HOSTS=${HOSTS:?the hosts, between blanks} CONFIG=${CONFIG:-rls2} N=${N:-1e8} OUT=${OUT:-results}
RSH=${RSH:-ssh} REMOTE=${REMOTE:-radarsim-share}
count=$(echo "$HOSTS" | wc -w)

number=0 jobs=
for host in $HOSTS; do
    number=$((number + 1))
    $RSH "$host" radarsim run "$CONFIG" -n "$N" --shard "$number/$count" --out "$REMOTE-$number" &
    jobs="$jobs $!"
done
for job in $jobs; do
    wait "$job"                        # a host that failed ends the script; run it again, and the others find all done
done

mkdir -p "$OUT"
number=0
for host in $HOSTS; do
    number=$((number + 1))
    $RSH "$host" tar -C "$REMOTE-$number" -cf - .blocks | tar -C "$OUT" -xf -
done
radarsim run "$CONFIG" -n "$N" --out "$OUT"
