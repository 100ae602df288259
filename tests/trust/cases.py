"""A small case of every study, and of every part of the sonar's that has kernels and tables of its own."""

from typing import NamedTuple

from radarsim.api.configs import load
from radarsim.api.maintenance.self_test import KNOWN_FOLDER
from radarsim.config.experiment import Experiment


class Small(NamedTuple):
    """A config and its overrides; realisations of at least eight blocks and a cut one, and as many as take seconds."""

    config: str
    overrides: tuple[str, ...]
    realisations: int
    longer: int

    def loaded(self, realisations: int | None = None) -> Experiment:
        """The experiment, of its realisations or of so many."""
        return load(self.config, [*self.overrides, f"realisations={realisations or self.realisations}"])

    def options(self, realisations: int | None = None) -> list[str]:
        """What `radarsim run` takes for it, of as many realisations as take seconds or of so many."""
        words = [word for override in self.overrides for word in ("--set", override)]
        return [self.config, *words, "-n", str(realisations or self.longer), "--no-figures", "--quiet"]


def known(study: str, realisations: int, longer: int) -> Small:
    """The case that `radarsim doctor` knows."""
    return Small(str(KNOWN_FOLDER / f"{study}.yaml"), (), realisations, longer)


DETECTORS = "{name: a, plots: 5, threshold_k: [1, 2]}, {name: b, plots: 4, test_every: 4, threshold_k: [2]}"
MANOEUVRE = ("sweep.target.acceleration_mps2=[0.4]", "scans=30", "uses.at_s=[140]", f"detectors=[{DETECTORS}]")
TRACKERS = ("sweep.sensor.false_plots_per_km2=[1]", "scans=12")
EKF = "kind: extended, sigma_acceleration_mps2: 2"
PLANE = f"filters=[{{name: a, doppler: false, {EKF}}}, {{name: b, doppler: true, {EKF}}}]", "baseline=a"
CASES = {
    "range_doppler": known("range_doppler", 70_001, 10_000_001),
    "multimodel": known("multimodel", 777, 250_001),
    "sonar": known("sonar", 36_001, 1_200_001),
    "sonar_manoeuvre": Small("sonar_manoeuvre", MANOEUVRE, 36_001, 90_001),
    "sonar_clutter": Small("sonar_clutter", TRACKERS, 36_001, 80_001),
    "discriminator": known("discriminator", 601, 50_001),
    "ambiguous_doppler": known("ambiguous_doppler", 4_501, 60_001),
    "pulses_to_tracks": Small("pulses", ("scans=5",), 4_501, 60_001),
    "plane": Small("plane", (*PLANE, "scans=8"), 4_501, 900_001),
}
# Further kinds of run, of rare events and of plots that are missed.
MORE = {
    "missed_plots": Small("sonar_missed", ("scans=12",), 20_001, 90_001),
    "rare_folds": Small("ambiguous_rare", ("sweep.radar.repetition_rate_hz=[900]", "scans=6"), 1_301, 60_001),
    "rare_losses": Small("discriminator_rare", ("sweep.estimators.0.lock_probability=[0.999]",), 301, 50_001),
    "rare_tracks": Small("sonar_clutter_rare", ("scans=8",), 9_001, 80_001),
    "plane_clutter": Small(
        "plane_clutter", (*PLANE, "scans=13", "sweep.radar.false_plots_per_km2=[0.1]"), 4_501, 300_001
    ),
    "rare_ends": Small("sonar_clutter_ends", ("scans=8",), 9_001, 80_001),
}
