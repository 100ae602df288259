"""The papers' claims as data, and verdicts on them from measured values, exact values and margins.

A claim says what the paper says, where, and how it was read; a part of it says what is measured and the range that the
paper's words leave to it. The ranges come from the words alone and were written down before anything was measured. The
rule by which they are judged: docs/verdicts.md and `radarsim.report.claims.rule`."""

# ruff: noqa: F401  (this is what others take from here)
from radarsim.report.claims.declared import (
    Claim,
    Evidence,
    Missing,
    PaperClaims,
    Part,
    Series,
    certain,
    common_times,
    minus,
    ratio,
)
from radarsim.report.claims.judge import (
    CLAIMED,
    NOT_JUDGED,
    NOT_RUN,
    NUMBERS,
    UNCLEAR,
    errors,
    failed,
    first_rows,
    judged,
    listed,
    verdict,
)
from radarsim.report.claims.rule import (
    CONFIRMED,
    REFUTED,
    Range,
    about,
    above,
    at_least,
    at_most,
    below,
    between,
    greater,
    kept,
    less,
    on_grid,
    printed,
    same,
    within,
)
