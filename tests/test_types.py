"""What type checkers and editors see of the package, and what its wheel holds."""

import radarsim


def test_dir_shows_what_can_be_called():
    assert {"ConfigError", "RadarsimError", "Result", "__version__", "load", "run"} <= set(dir(radarsim))
    for name in radarsim.__all__:
        assert getattr(radarsim, name) is not None
