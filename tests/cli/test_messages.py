"""What the command says of what needs no results: why it refuses, and what it shows. A line each, `words => said`."""

import shlex

import pytest

from tests.program import command

REFUSED = """
run => CONFIG
run rls7 => no such config
run rls2 -n 0 => realisations
run rls2 -n 1e13 => realisations
run rls2 -n many => must be a whole number
run rls2 --set radar.sigma_range_m=-1 => radar.sigma_range_m
run rls2 --set radar.sigma_rnage_m=1 => did you mean
run rls2 --shard 0/3 => i/n with i from 1 to n
run rls2 --shard 4/3 => i/n with i from 1 to n
run rls2 --shard 1/0 => i/n with i from 1 to n
run rls2 --shard two => i/n with i from 1 to n
run rls2 --shard 1/2 --precision 1 => --shard and --precision do not go together
run rls2 --precision 0 => must be a number > 0
run rls2 --precision -1 => must be a number > 0
run rls2 --precision nan => must be a number > 0
run rls2 --precision 101 => ≤ 100
run ambiguous_rls2 --precision 1 --of above-orcle => smoothed; did you mean above_oracle?
run rls2 --precision 1 --of speed => rls2: study range_doppler measures no 'speed', but sigma, gain
run rls2 --precision 1 -n 1999 => rls2.yaml: realisations: must be at least 2000 for a precision
run rls2 --of gain => --of and --for apply to --precision
run rls2 --time-limit 0 => must be a number > 0
run rls2 --time-limit inf => must be a number > 0
run rls2 --workers 0 => --workers
run rls2 --workers 2 --scheduler tcp://a:1 => do not go together
run rls2 --workers 2 --threads 2 => do not go together
run rls2 --scheduler nowhere => must be an address such as tcp://host:8786
run rls2 --decide => no claim names this config; claims of its study name range_doppler
run range_doppler --decide --precision 1 => --decide goes with neither --shard nor --precision
run range_doppler --decide --shard 1/2 => --decide goes with neither --shard nor --precision
run rls2 -n 10 --out '' => '--out': must name a directory, got ''
report rls2 --out '' => '--out': must name a directory, got ''
report rls2 --out nowhere => not stored
claims --out '' => '--out': must name a directory, got ''
claims rls7 => no such config
clean --out '' => '--out': must name a directory, got ''
clean --out nowhere => no such directory
clean rls7 => no such config
clean --seed 1 => need a CONFIG
doctor . => no run.json
doctor nowhere => no such folder
doctor --recompute 1 => --recompute needs a RESULT
check rls2 --of gain => give --precision too
check rls2 --precision 1 --shard 1/2 => do not go together
new ../mine --like rls1 => must be a plain name
new other --like rls9 => no such config
simulate discriminator -o x.csv => draws no plots
track discriminator x => has no filters for recorded plots
solve rls2 radar.sigma_range_m --equals 30 => --sigma, --gain, …; got none
solve rls2 radar.sigma_range_m --gain r --sigma r --equals 30 => --sigma, --gain, …; got gain, sigma
solve rls2 radar.sigma_range_m --gain r --at 60 --at-k 3 --equals 30 => --at and --at-k do not go together
solve discriminator burst.noise_variance --lock sequence --filter x --equals 3 => --lock names the filter itself
solve rls2 radar.sigma_range_m --gain r => Error
solve rls2 radar.sigma_range_m --sigma r --filter r --equals nan --json => --equals: must be a finite number
solve rls2 radar.sigma_range_m --sigma r --filter r --equals inf --json => --equals: must be a finite number
solve rls2 radar.sigma_range_m --sigma r --filter r --equals -inf --json => --equals: must be a finite number
solve rls2 key --loss --filter x --equals 5 => '--loss': must be followed by a NAME, of the filter itself
solve rls2 key --gain --filter r+Vr --equals 5 => '--gain': must be followed by a COMPONENT, got --filter
"""
SHOWN = """
check range_doppler -n 1e7 => valid | rls1 | rls5 | 10,000,000 | MB
check rls2 -n 4000 --precision 0.5 => precision not within reach of 1 case: rls2; -n 128000 would do
list => rls1 | range_doppler | 26 scenarios | 31 filters
list filters => range_doppler | observes: [range, velocity]
schema => "$schema": "https://json-schema.org/
"""


def lines(text):
    return pytest.mark.parametrize(("given", "said"), [line.split(" => ") for line in text.strip().splitlines()])


@lines(REFUSED)
def test_what_is_refused_is_told_and_leaves_nothing(given, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ended = command(*shlex.split(given), code=2)
    assert said in ended.stderr
    assert ended.stdout == ""
    assert not list(tmp_path.iterdir())


@lines(SHOWN)
def test_what_is_shown(given, said):
    text = command(*shlex.split(given)).stdout
    assert not [part for part in said.split(" | ") if part not in text]
