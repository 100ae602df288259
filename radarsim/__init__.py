"""radarsim: Monte-Carlo experiments on radar and sonar track processing.

>>> import radarsim
>>> result = radarsim.run("rls2", realisations=1e4)
>>> result.gains.columns[0]
'case'
>>> result.figure("gain_r")  # doctest: +ELLIPSIS
<PrintableFigure size ...>

In a notebook a result shows its answer and first figure; `radarsim.load("rls2")` gives one that was run before.
`check`, `solve`, `tune`, `sensitivity`, `compare`, `chart`, `claims` and `interpretations` do what the commands of
these names do; `plots` gives those of many realisations as arrays; `simulate`, `read_plots`, `track`, `fit` and
`register` are for recorded plots."""

import warnings
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from radarsim.api.compare import compare
    from radarsim.api.cost_estimate import check
    from radarsim.api.design.sensitivity import sensitivity
    from radarsim.api.design.solve import solve
    from radarsim.api.design.tune import tune
    from radarsim.api.doppler_chart import chart
    from radarsim.api.judge import judge
    from radarsim.api.result import Result
    from radarsim.api.run import run
    from radarsim.api.stored_result import load
    from radarsim.errors import ConfigError, RadarsimError
    from radarsim.papers.judge_interpretations import interpretations
    from radarsim.papers.list_claims import claims
    from radarsim.recordings.python import fit, plots, read_plots, register, simulate, track

__version__ = "0.3.0"
__all__ = [
    "ConfigError",
    "RadarsimError",
    "Result",
    "__version__",
    "chart",
    "check",
    "claims",
    "compare",
    "fit",
    "interpretations",
    "judge",
    "load",
    "plots",
    "read_plots",
    "register",
    "run",
    "sensitivity",
    "simulate",
    "solve",
    "track",
    "tune",
]

_HOMES = {
    "ConfigError": "errors:ConfigError",
    "RadarsimError": "errors:RadarsimError",
    "Result": "api.result:Result",
    "chart": "api.doppler_chart:chart",
    "check": "api.cost_estimate:check",
    "claims": "papers.list_claims:claims",
    "compare": "api.compare:compare",
    "interpretations": "papers.judge_interpretations:interpretations",
    "judge": "api.judge:judge",
    "load": "api.stored_result:load",
    "run": "api.run:run",
    "sensitivity": "api.design.sensitivity:sensitivity",
    "solve": "api.design.solve:solve",
    "tune": "api.design.tune:tune",
    **{name: f"recordings.python:{name}" for name in ("fit", "plots", "read_plots", "register", "simulate", "track")},
}
_OLD_NAMES = {"readings": "interpretations"}


def __getattr__(name: str) -> object:
    # Imported on first use, so that `radarsim --help` loads neither NumPy nor Numba.
    if name in _OLD_NAMES:
        new = _OLD_NAMES[name]
        warnings.warn(f"radarsim.{name} is called radarsim.{new}", DeprecationWarning, stacklevel=2)
        name = new
    if name in _HOMES:
        module, _, attribute = _HOMES[name].partition(":")
        return getattr(import_module(f"radarsim.{module}"), attribute)
    raise AttributeError(f"module 'radarsim' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__} - {"TYPE_CHECKING", "_HOMES", "_OLD_NAMES", "import_module", "warnings"})
