"""What is said of tracks over recorded plots: rows, gaps, errors, how well the stated accuracies fit, advice."""

from collections.abc import Sequence

from radarsim.recorded import accuracy, advice
from radarsim.recorded.advice import Advice, Finding
from radarsim.recorded.follow import Followed
from radarsim.report.text import plural, significant_digits

CLEAR = 3.0  # of the logarithm of a likelihood, twenty times: from there on one filter is clearly the best


def sentences(followed: Followed, judged: Sequence[accuracy.Judged], advised: Advice | None) -> list[str]:
    """All that is said, a line each; advised: where a likelihood is known."""
    lines = [tested(one, advised is None) for one in judged if one.tests]
    return [*rows(followed), *errors(followed), *lines, *verdict(judged, advised)]


def verdict(judged: Sequence[accuracy.Judged], advised: Advice | None) -> list[str]:
    """Which filter is best, and what is to be changed: by the likelihood where it is known."""
    return nearest(judged) if advised is None else likely(advised)


def rows(followed: Followed) -> list[str]:
    """How many rows and tracks there are, over what time, what is missing, and the gaps."""
    span = followed.last_s - followed.first_s
    lines = [f"plots    {plural(followed.rows, 'row')} over {span:g} s, from {followed.first_s:g} s"]
    if followed.tracks:
        longest_rows = max(one.rows for one in followed.tracks.values())
        lines.append(f"tracks   {len(followed.tracks)}, the longest of {plural(longest_rows, 'row')}")
    if followed.passed_over:
        lines.append(f"passed   {plural(followed.passed_over, 'row')} of no track")
    missing = ", ".join(f"{count} of {name}" for name, count in followed.missing.items() if count)
    if missing:
        lines.append(f"missing  {missing}")
    if followed.silent:
        lines.append(f"no rows  {', '.join(followed.silent)}: never an estimate from these plots")
    if followed.gaps:
        longest = f"the longest {followed.longest_gap_s:g} s, after {followed.longest_gap_at_s:g} s"
        lines.append(
            f"gaps     {followed.gaps} of over three times the usual interval, {followed.median_s:g} s; {longest}"
        )
    return lines


def errors(followed: Followed) -> list[str]:
    """What the filters missed the truth by, where the file has it."""
    return [
        f"{one.filter}, {one.component}: error against the truth {significant_digits(one.rms)} {one.unit} RMS, "
        f"{significant_digits(one.ratio, '#.3g')} of what the filter believes ({one.count} estimates)"
        for one in followed.errors.values()
        if one.count
    ]


def tested(one: accuracy.Judged, cured: bool) -> str:
    """One test; cured: with the σ under which it would be passed, where it is not."""
    finding = {
        accuracy.FITS: "the stated σ fits",
        accuracy.SMALL: "the stated σ is too small, or the target manoeuvres harder than the filter allows",
        accuracy.LARGE: "the stated σ is too large, or the filter allows for harder manoeuvres than there are",
        accuracy.UNKNOWN: "too few plots to decide",
    }[one.verdict]
    bounds = f"NIS {one.nis:.3g} of {plural(one.tests, 'plot')}, 95 % of right filters [{one.lo:.3g}, {one.hi:.3g}]"
    better = ", ".join(f"{key} {value:.4g}" for key, value in one.better.items())
    return f"{one.filter}, {one.name}: {bounds}: {finding}" + (f"; {better} would" if better and cured else "")


def nearest(judged: Sequence[accuracy.Judged]) -> list[str]:
    """What to write into the config: of the filter whose tests are most nearly right."""
    verdicts: dict[str, set[str]] = {}
    for one in judged:
        verdicts.setdefault(one.filter, set()).add(one.verdict)
    if fitting := [name for name, found in verdicts.items() if found == {accuracy.FITS}]:
        return [f"         {', '.join(fitting)}: all tests fit"] if len(fitting) < len(verdicts) else []
    wrong = [one for one in judged if one.better]
    if not wrong or len({one.filter for one in wrong}) < 2:
        return []
    best = min((one for one in wrong), key=lambda one: abs(one.nis - 1))
    own = {key: value for one in wrong if one.filter == best.filter for key, value in one.better.items()}
    settings = " ".join(f"--set {key}={value:.4g}" for key, value in own.items())
    return [f"         nearest is {best.filter}; with its better values: {settings}"]


def likely(advised: Advice) -> list[str]:
    """Which filter foretells the plots best, and what is wrong with its numbers."""
    compared, lines = advised.compared, []
    if len(compared.behind) > 1:
        behind = sorted((name, gap) for name, gap in compared.behind.items() if name != compared.best)
        others = ", ".join(f"exp({-gap:.1f}) times under {name}" for name, gap in behind)
        clear = "" if min(gap for _, gap in behind) > CLEAR else " (not clearly)"
        lines.append(f"best     {compared.best}{clear}; elsewhere the plots are less likely: {others}")
    if not advised.findings:
        lines.append(f"advice   nothing is wrong with the stated numbers, as far as {plural(advised.rows, 'row')} tell")
    for one in advised.findings:
        lines.append(f"advice   {_explained(one)}; the plots are then more likely by exp({one.gain:.1f})")
    return lines


def _explained(one: Finding) -> str:
    """What is wrong, in words."""
    if one.what == advice.OUTLIERS:
        return f"outliers: {significant_digits(100 * one.value, '#.2g')} % of the plots err by ten times their σ"
    if one.what == advice.BIAS:
        return f"the measured velocities are off by {significant_digits(one.value, '#.3g')} of their σ, all alike"
    return f"--set {one.what}={one.value:.4g}"
