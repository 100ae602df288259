"""radarsim: Monte-Carlo experiments on radar and sonar track processing.

>>> import radarsim
>>> result = radarsim.run("rls2", realisations=1e4)
>>> result.gains.columns[0]
'case'
"""

from importlib import import_module

__version__ = "0.1.0"
__all__ = ["ConfigError", "RadarsimError", "Result", "__version__", "run"]

_HOMES = {"run": "experiment", "Result": "result", "ConfigError": "errors", "RadarsimError": "errors"}


def __getattr__(name: str):
    # Imported on first use, so that `radarsim --help` loads neither NumPy nor Numba.
    if name in _HOMES:
        return getattr(import_module(f"radarsim.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'radarsim' has no attribute {name!r}")
