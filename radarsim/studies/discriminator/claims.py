"""P4.1 … P4.10: what Uss, Baryshev & Djavad (2010) say, read from their words alone.

Places are the article's sections (Aviacionno-kosmicheskaya tehnika i tehnologiya 2010, no. 6): 3 holds the method, 4
the experiment. Its numbers are judged in both readings of its noise and threshold, see discriminator_measures.
"""

from radarsim.report.claims import Claim, Part, about, above, at_most, below, certain, printed, within
from radarsim.studies.discriminator.measures import COMPONENTS, COMPUTED, ESTIMATE, PRINTED, WORDS, Evidence

__all__ = ["CLAIMS", "Evidence"]

PAPER, MAPS = "discriminator_paper", "discriminator_maps"
SPREADS = {
    "phi0": ("0.061", "rad"),
    "f0": ("0.45", "Hz"),
    "f1": ("12.2", "Hz/s"),
    "f2": ("183.38", "Hz/s²"),
    "f3": ("1213.04", "Hz/s³"),
}
SCALE, NOISE, ERROR = "prior.scale", "burst.noise_variance", "prior.error_scale"


def _claim(number: int, place: str, statement: str, *parts: Part, reading: str = "", config: str = PAPER) -> Claim:
    return Claim(f"P4.{number}", place, statement, parts, reading, config)


def _both(what: str, unit: str, measure, expected) -> list[Part]:
    """A part for each reading; measure(evidence, key)."""
    return [
        Part((key,), f"{what} ({WORDS[key]})", unit, lambda seen, key=key: measure(seen, key), expected)
        for key in (COMPUTED, PRINTED)
    ]


def _spread(key: str, component: str) -> Part:
    number, unit = SPREADS[component]
    what = f"potential spread of {component} ({WORDS[key]})"
    return Part((key,), what, unit, lambda seen: seen.potential(key, component), printed(number))


CLAIMS = (
    _claim(
        1,
        "section 4",
        "The potential spreads are 0.061 rad, 0.45 Hz, 12.2 Hz/s, 183.38 Hz/s², 1213.04 Hz/s³",
        *(_spread(key, component) for key in (COMPUTED, PRINTED) for component in COMPONENTS),
        reading="by the paper's own matrix for T = 0.3 s; the last digits of the last two need one period less",
    ),
    _claim(
        2,
        "section 4",
        "The first window is 1.79 ms, the shortest allowed 1.31 ms",
        *_both("first window", "ms", lambda seen, key: certain(1e3 * seen.windows(key)[0]), printed("1.79")),
        *_both(
            "shortest window at the paper's amplitude 1.17",
            "ms",
            lambda seen, key: seen.shortest_window(key, ESTIMATE),
            printed("1.31"),
        ),
    ),
    _claim(
        3,
        "section 4, conclusion",
        "From the first window to the whole burst it takes 12 iterations",
        *_both("windows after the first", "", lambda seen, key: certain(len(seen.windows(key)) - 1), within(12, 12)),
    ),
    _claim(
        4,
        "section 4, conclusion",
        "The last discriminator reaches the potential accuracy",
        *(
            part
            for component in COMPONENTS
            for part in _both(
                f"σ of {component} over the potential one, locked bursts",
                "",
                lambda seen, key, component=component: seen.accuracy(key, "sequence", component),
                about("1"),
            )
        ),
        reading="of the bursts that lock; P4.5 says how many do",
    ),
    _claim(
        5,
        "section 4, figure 2",
        "Every error stays under three potential spreads at every window",
        *_both("share of bursts of which this is true", "", lambda seen, key: seen.always(key), within(0.99, 1)),
        *_both("share of bursts locked at the end", "", lambda seen, key: seen.lock(key, "sequence"), within(0.99, 1)),
        reading="shown for one burst; over many, as often as the design promises: 0.99. Spreads with the prior",
    ),
    _claim(
        6,
        "section 3",
        "A narrow discriminator alone loses the signal from such a forecast",
        *_both(
            "share of bursts locked by the whole burst alone",
            "",
            lambda seen, key: seen.lock(key, "narrow"),
            at_most(0.01),
        ),
        reading="loses: locks less often than the 0.01 that the design allows to be lost",
    ),
    _claim(
        7,
        "section 3",
        "A wide discriminator alone has a lower accuracy",
        *(
            part
            for component in COMPONENTS[:2]
            for part in _both(
                f"σ of {component} of the first window over the potential one of the burst",
                "",
                lambda seen, key, component=component: seen.over_whole(key, "wide", component),
                above(1),
            )
        ),
    ),
    _claim(
        8,
        "section 3, after (16)",
        "The better the forecast, the nearer the first window is to the whole burst",
        *(
            Part(
                ((SCALE, better), (SCALE, worse)),
                f"first window with the forecast's spread × {better:g} over that with × {worse:g}",
                "",
                lambda seen, b=better, w=worse: certain(seen.windows((SCALE, b))[0] / seen.windows((SCALE, w))[0]),
                above(1),
            )
            for worse, better in ((10, 1), (1, 0.1), (0.1, 0.01), (0.01, 0.001))
        ),
        config=MAPS,
    ),
    _claim(
        9,
        "section 3, before (17)",
        "At a low signal-to-noise ratio noise masks the main peak: the lock is lost unacceptably often",
        Part(
            ((NOISE, 72), (NOISE, 2.25)),
            "lock of the cured sequence where μ(T₀) < 1 less that where μ(T₀) > 20",
            "",
            lambda seen: seen.lock_loss((NOISE, 72), (NOISE, 2.25), "cured"),
            below(0),
        ),
        Part(
            ((NOISE, 72),),
            "lock of the cured sequence where μ(T₀) < 1",
            "",
            lambda seen: seen.lock((NOISE, 72), "cured"),
            below(0.99),
        ),
        reading="the sequence with a search at the hand-overs, which the paper's own losses do not blur",
        config=MAPS,
    ),
    _claim(
        10,
        "section 3, after (16)",
        "The covariance of the forecast must be estimated rightly",
        *(
            Part(
                ((ERROR, factor), (ERROR, 1)),
                f"lock with errors {factor:g} times those believed less that with right ones",
                "",
                lambda seen, factor=factor: seen.lock_loss((ERROR, factor), (ERROR, 1), "sequence"),
                below(0),
            )
            for factor in (2, 4)
        ),
        reading="a forecast worse than believed; one that is better than believed only costs windows",
        config=MAPS,
    ),
)
