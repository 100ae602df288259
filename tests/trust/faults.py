"""Faults of meaning: thirty slips that would give plausible, wrong numbers, each with a test that must notice it.

Such as no change of an operator makes: a seed that is ignored, gains that are not paired, a table's exact value lost.
Each puts a wrong function in the place of the right one wherever a module holds it, so that a fault knows a name and
what its function means, and no source text. `python -m tests.trust.faults [WORD…]`, part of `make mutants`, tries
those whose name has a WORD, each in a process of its own, and ends with 1 where a test notices nothing.
"""

import dataclasses
import functools
import importlib
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
CHOSEN = "RADARSIM_FAULT"  # names the fault that a process of pytest is to have


class Fault(NamedTuple):
    """The function at `place`, module:name or module:class.name, becomes what `wrong` makes of it; `test` notices."""

    place: str
    wrong: Callable[[Callable], Callable]
    test: str

    def plant(self) -> None:
        """Put the wrong function wherever a module that is loaded, or will be, finds the right one."""
        module, _, name = self.place.partition(":")
        held: Any = functools.reduce(getattr, name.split(".")[:-1], importlib.import_module(module))
        name = name.split(".")[-1]
        right = getattr(held, name)
        wrong = functools.wraps(right)(self.wrong(right))
        setattr(held, name, wrong)
        for other in [m for n, m in sys.modules.items() if n.startswith("radarsim")]:
            for key in [key for key, value in vars(other).items() if value is right]:
                setattr(other, key, wrong)


FAULTS: dict[str, Fault] = {}


def fault(place: str, test: str) -> Callable[[Callable[[Callable], Callable]], None]:
    """Declare the decorated function, which makes the wrong of the right one, as the fault of its name."""

    def declared(wrong: Callable[[Callable], Callable]) -> None:
        FAULTS[wrong.__name__] = Fault(f"radarsim.{place}", wrong, f"tests/{test}")

    return declared


def reseeded(case: Any, seed: int = 1) -> Any:
    return dataclasses.replace(case, seed=seed)


# ---- noise and identity -------------------------------------------------------------------------------------------
P1_STUDY = "studies/range_doppler/test_study.py"
OTHER_NOISE = "trust/test_faults.py::test_seeds_and_streams_have_noise_of_their_own"
P1_EXACT = "studies/range_doppler/test_exact.py"
OTHER_SEED = "studies/test_all_studies.py::test_a_case_is_the_same_elsewhere_and_another_with_another_seed"
IDENTITY = "config/test_identity.py::test_labels_and_spelt_out_defaults_change_nothing"


@fault("studies.noise:noise_key", "config/test_identity.py::test_filters_and_scans_change_the_case_but_not_its_noise")
def noise_of_the_filters_too(right):
    """Gains of cases that differ in their filters would not be paired."""
    return lambda case, what: right(case, f"{what}{case.spec!r}")


@fault("studies.noise:noise_key", OTHER_NOISE)
def noise_of_one_seed(right):
    return lambda case, what: right(reseeded(case), what)


@fault("studies.noise:noise_key", OTHER_NOISE)
def one_stream_for_all_noise(right):
    """Range and velocity would err together."""
    return lambda case, what: right(case, "noise")


@fault("studies.identity:identity", OTHER_SEED)
def seed_not_in_the_identity(right):
    return lambda case: right(reseeded(case))


@fault("studies.identity:identity", IDENTITY)
def names_in_the_identity(right):
    return lambda case: right(case)[:32] + repr(case.spec)


@fault("api.case_work:CaseWork.simulate", f"{P1_STUDY}::test_every_sigma_is_exact_within_its_statistical_error")
def every_block_is_the_first(right):
    return lambda work, first, count: right(work, 0, count)


# ---- sums and stored blocks ---------------------------------------------------------------------------------------
@fault("engine.sums:Sums.__add__", "engine/test_blocks.py::test_sums_are_a_commutative_monoid_where_addition_is_exact")
def realisations_of_one_side_counted(right):
    return lambda one, other: type(one)(one.count, right(one, other).values)


@fault("engine.blocks:add_sums", "engine/test_blocks.py::test_an_overflow_between_blocks_is_no_result")
def sums_that_overflow_pass(right):
    return lambda left, right_, first: left + right_


@fault("engine.blocks:share_bound", "engine/test_share.py::test_shares_tile_the_blocks_and_the_last_has_the_cut_one")
def shares_overlap(right):
    return lambda blocks, number, of: min(right(blocks, number, of) + (number > 0), blocks)


@fault("engine.sums:Layout.unpack", "trust/test_faults.py::test_what_is_packed_is_unpacked")
def arrays_of_sums_in_another_order(right):
    def unpacked(layout, values):
        names = sorted(layout.shapes, reverse=True)
        turned = right(type(layout)(**{name: layout.shapes[name] for name in names}), values)
        return {name: turned[name] for name in layout.shapes}

    return unpacked


@fault("engine.store.block_file:check_block", "engine/test_store.py")
def a_block_of_another_case_is_read(right):
    return lambda header, values, expected: None


@fault(
    "engine.store.audit:agree", "engine/test_audit.py::test_sums_that_were_forged_with_a_right_checksum_do_not_add_up"
)
def forged_sums_agree(right):
    return lambda *_: True


# ---- statistics ---------------------------------------------------------------------------------------------------
@fault("report.statistics:gain", "trust/test_statistics.py::test_pairing_narrows_a_gain")
def unpaired_gains(right):
    return lambda square, fourth, base, base_fourth, cross, n: right(
        square, fourth, base, base_fourth, square * base / n, n
    )


@fault("report.statistics:quantile", "trust/test_statistics.py::test_bounds_for_many_looks")
def many_bounds_as_wide_as_one(right):
    return lambda looks: right(1)


@fault("report.statistics:student", "report/test_statistics.py::test_student_against_the_library")
def one_degree_of_freedom_too_many(right):
    return lambda freedom: right(freedom + 1)


@fault("report.statistics:errors", "report/test_statistics.py::test_by_hand")
def spread_about_the_truth(right):
    """A bias would count as spread."""
    return lambda moments, n: (of := right(moments, n))._replace(spread=of.sigma.value)


@fault("report.statistics:errors", "report/test_statistics.py::test_by_hand")
def sigma_about_the_mean(right):
    """A bias would not count as error."""
    return lambda moments, n: (of := right(moments, n))._replace(sigma=of.sigma._replace(value=of.spread))


@fault("report.statistics:effective", "report/test_statistics.py::test_effective_realisations")
def every_realisation_is_effective(right):
    return lambda square, fourth, n: n + 0 * right(square, fourth, n)


@fault("report.statistics:probability", "report/test_statistics.py::test_rate_is_wilsons")
def a_rate_never_seen_is_zero_for_certain(right):
    def plain(total, square, n):
        of = right(total, square, n)
        half = 1.96 * (of.value * (1 - of.value) / n) ** 0.5
        return of._replace(lo=of.value - half, hi=of.value + half)

    return plain


@fault("report.statistics:gain", "report/test_tables.py::test_gains_are_against_the_baseline")
def gain_of_the_baseline_over_the_filter(right):
    return lambda square, fourth, base, base_fourth, *more: right(base, base_fourth, square, fourth, *more)


# ---- tables, notes and verdicts -----------------------------------------------------------------------------------
@fault("report.tables:exact_first", "report/test_tables.py::test_exact_values_come_first")
def measured_values_hide_exact_ones(right):
    return lambda rows, value, exact: right(rows, value, value)


@fault("report.tables:realisation_counts", "report/test_tables.py::test_fewer_estimates_than_realisations")
def estimates_divided_by_all_realisations(right):
    return lambda result: right(SimpleNamespace(axes=result.axes, count=result.count, sums={}))


@fault(
    "report.tables:component_columns", "report/test_tables.py::test_rows_in_order_and_only_where_there_is_an_estimate"
)
def rows_under_another_component(right):
    return lambda result, c: right(result, len(result.axes.components) - 1 - c)


@fault("report.interval_notes:is_exact", "report/test_row_notes.py::test_no_note_stands_beside_an_exact_value")
def notes_beside_exact_values(right):
    return lambda table: right(table) & False


@fault("papers.verdict_rule:widening_factor", "report/test_verdict_rule.py::test_level_is_of_all_parts")
def each_part_judged_as_if_alone(right):
    return lambda parts: right(1)


@fault("papers.verdict_rule:judged_interval", "report/test_verdict_rule.py::test_exact_first")
def exact_values_judged_by_their_sample(right):
    return lambda part, parts=1: right(dataclasses.replace(part, exact=float("nan")), parts)


# ---- worlds and exact values --------------------------------------------------------------------------------------
@fault("physics.frames:rotation", "physics/test_frames.py::test_rotation_is_a_right_hand_turn")
def a_left_hand_turn(right):
    return lambda azimuth, elevation: right(-azimuth, elevation)


@fault("physics.motion:transition", "physics/test_targets.py::test_transition_is_the_papers_matrix")
def acceleration_moves_nothing(right):
    return lambda dt, size=3: right(dt, size) * [[abs(i - j) < 2 for j in range(size)] for i in range(size)]


@fault(
    "studies.range_doppler.error_recursion:error_recursion",
    f"{P1_EXACT}::test_a_quadratic_truth_leaves_no_bias_and_a_cubic_one_does",
)
def bias_of_the_first_estimate_lost(right):
    def started(one, *more):
        bias, covariance = right(one, *more)
        bias[one.start - 1] = 0.0
        return bias, covariance

    return started


@fault("studies.range_doppler.steady_state:steady_state", f"{P1_EXACT}::test_settles_to_the_steady_state")
def what_a_filter_believes_is_true(right):
    return lambda *given: (right(*given)[0],) * 2


@fault("studies.range_doppler.error_recursion:error_recursion", f"{P1_EXACT}::test_agrees_with_an_outside_calculation")
def gains_of_a_filter_without_process_noise(right):
    return lambda one, *more: right(dataclasses.replace(one, noise=(0.0,) * len(one.noise)), *more)


# ---- how they are tried -------------------------------------------------------------------------------------------
def pytest_configure() -> None:
    """This module is a plugin of the processes that `notices` starts."""
    if name := os.environ.get(CHOSEN):
        FAULTS[name].plant()


def notices(name: str | None, test: str, cache: str) -> bool:
    """Whether a test fails with a fault, or with none."""
    own = {"PYTHONPATH": str(ROOT), "RADARSIM_CACHE_DIR": cache, CHOSEN: name or ""}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "tests.trust.faults", test]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | own, capture_output=True, text=True, check=False)
    broken = re.search(r"^E +(TypeError|AttributeError|NameError)", done.stdout, re.MULTILINE)  # the fault itself is
    if done.returncode not in (0, 1) or broken:
        raise RuntimeError(f"{name}: pytest ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return done.returncode == 1


def main(words: list[str]) -> int:
    chosen = {name: one for name, one in FAULTS.items() if not words or any(word in name for word in words)}
    lost = 0
    with tempfile.TemporaryDirectory() as cache:
        for test in dict.fromkeys(one.test for one in chosen.values()):
            if notices(None, test, cache):
                sys.stdout.write(f"{test} fails without a fault\n")
                lost += 1
        for name, one in chosen.items():
            begun = time.perf_counter()
            caught = notices(name, one.test, cache)
            lost += not caught
            sys.stdout.write(f"{'caught' if caught else 'SURVIVED':8} {time.perf_counter() - begun:4.0f} s  {name}\n")
            sys.stdout.flush()
    return 1 if lost or not chosen else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
