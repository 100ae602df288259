#!/bin/sh
# A Dask cluster: a scheduler here, a worker process for each core of each host, and a run that hands blocks to them.
# Workers may come and go meanwhile.
#   HOSTS="a b c" SCHEDULER=head.example:8786 CONFIG=rls2 N=1e9 OUT=results sh docs/recipes/dask.sh
# Every host has `pip install 'radarsim[cluster]'` of one version. RSH replaces ssh.
set -eu
HOSTS=${HOSTS:?the hosts, between blanks} SCHEDULER=${SCHEDULER:-$(hostname):8786}
CONFIG=${CONFIG:-rls2} N=${N:-1e8} OUT=${OUT:-results} RSH=${RSH:-ssh} WORKERS=${WORKERS:-auto}

started=
trap 'kill $started 2>/dev/null || true' EXIT
dask scheduler --host "${SCHEDULER%:*}" --port "${SCHEDULER##*:}" --no-dashboard 2>/dev/null &
started=$!
for host in $HOSTS; do
    $RSH "$host" dask worker "tcp://$SCHEDULER" --nworkers "$WORKERS" --nthreads 1 --no-dashboard 2>/dev/null &
    started="$started $!"
done
waited=0                               # the scheduler must answer before the run asks for it
until python3 -c "import socket, sys; socket.create_connection((sys.argv[1], int(sys.argv[2])), 1)" \
    "${SCHEDULER%:*}" "${SCHEDULER##*:}" 2>/dev/null; do
    waited=$((waited + 1))
    [ "$waited" -le "${PATIENCE:-60}" ] || { echo "no scheduler answers at $SCHEDULER" >&2; exit 1; }
    sleep 1
done
radarsim run "$CONFIG" -n "$N" --scheduler "tcp://$SCHEDULER" --out "$OUT"
