"""From keys to rules and tests: filters that respond to manoeuvres, and their detectors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from radarsim.studies.sonar import filter_banks
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.detector_arrays import AdaptiveRule, DetectorTest, ModelPair, detector_arrays
from radarsim.studies.sonar.detector_keys import Detector
from radarsim.studies.sonar.filter_design import FilterSpec
from radarsim.studies.sonar.filter_keys import Filter
from radarsim.studies.sonar.kernels.detector import Detectors
from radarsim.studies.sonar.manoeuvre import detection_laws
from radarsim.studies.sonar.manoeuvre.phases import phases
from radarsim.studies.sonar.scene import Scene, lateral_scale


def responding_filters(spec: Keys, specs: Sequence[FilterSpec]) -> list[FilterSpec]:
    """The filters of a case; those that respond to manoeuvres get their rule or their models."""
    scale = lateral_scale(spec, 2)
    return [
        replace(
            filter_spec,
            response=_filter_response(member, scale),
            length=member.detector.plots if member.detector else filter_spec.length,
        )
        for filter_spec, member in zip(specs, spec.filters, strict=True)
    ]


def _filter_response(member: Filter, scale: np.ndarray) -> AdaptiveRule | ModelPair | None:
    """The response of a configured filter to manoeuvres; scale (C,) converts (m/s²)² to each coordinate's units."""
    if member.manoeuvre_variances and member.stay_probabilities:
        return ModelPair(scale[:, None] * np.array(member.manoeuvre_variances), np.array(member.stay_probabilities))
    detector = member.detector
    if detector is None:
        return None
    joint, limit = detector.coordinates == "joint", detector.threshold_k
    if detector.false_alarm_probability is not None:
        limit = float(detection_laws.threshold(detector.false_alarm_probability, len(scale) if joint else 1))
    raises = member.response != "shorten_memory"
    return AdaptiveRule(np.full(len(scale), limit), detector.test_every, joint, raises, member.end_after or 1)


def thresholds(detector: Detector, coordinates: int) -> np.ndarray:
    """Thresholds (G, T) of a configured detector."""
    if detector.threshold_k is not None:
        return np.tile(np.array(detector.threshold_k), (coordinates + 1, 1))
    freedom = np.append(np.ones(coordinates, dtype=int), coordinates)[:, None]
    return detection_laws.threshold(np.array(detector.false_alarm_probability), freedom)


def all_detectors(spec: Keys, scene: Scene, specs: Sequence[FilterSpec]) -> Detectors:
    """The measured detectors of a case, then those of its adaptive filters."""
    C = len(scene.nominal)
    measured = [
        DetectorTest(detector.plots, detector.test_every, thresholds(detector, C)) for detector in spec.detectors
    ]
    return detector_arrays(measured, filter_banks.needed_tests(specs), phases(spec.target, scene.t), C)
