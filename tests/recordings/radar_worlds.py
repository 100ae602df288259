"""Recordings of a radar whose errors are known, among them errors that its four biases do not describe.

The geometry is that of the ellipsoid (WGS 84), written here again: no function of the package computes it."""

import numpy as np
import pandas as pd

SEMI_MAJOR_M, FLATTENING = 6378137.0, 1 / 298.257223563
SQUARED_ECCENTRICITY = FLATTENING * (2 - FLATTENING)
SITE = (np.radians(52.3), np.radians(4.76), 12.0)
SIGMA_RANGE_M, SIGMA_BEARING_RAD = 40.0, 1e-3
RANGE_M, BEARING_RAD, TIME_S = 80.0, np.radians(0.2), 0.5  # true biases; the scale is 0
ROTATION_S = 4.0


def earth_fixed(latitude, longitude, height):
    """Positions (3, …) in axes of the earth."""
    normal = SEMI_MAJOR_M / np.sqrt(1 - SQUARED_ECCENTRICITY * np.sin(latitude) ** 2)
    return np.array(
        [
            (normal + height) * np.cos(latitude) * np.cos(longitude),
            (normal + height) * np.cos(latitude) * np.sin(longitude),
            (normal * (1 - SQUARED_ECCENTRICITY) + height) * np.sin(latitude),
        ]
    )


def local(latitude, longitude, height):
    """Positions (3, …) north, up and east of the radar."""
    latitude_0, longitude_0, _ = SITE
    x, y, z = earth_fixed(latitude, longitude, height) - earth_fixed(*SITE).reshape(3, *[1] * np.ndim(height))
    outward = np.cos(longitude_0) * x + np.sin(longitude_0) * y
    east = -np.sin(longitude_0) * x + np.cos(longitude_0) * y
    north = -np.sin(latitude_0) * outward + np.cos(latitude_0) * z
    return np.array([north, np.cos(latitude_0) * outward + np.sin(latitude_0) * z, east])


class Aircraft:
    """An aircraft at a constant height, with a constant speed over an almost straight line."""

    def __init__(self, rng, nearest_m, farthest_m):
        distance, azimuth = rng.uniform(nearest_m, farthest_m), rng.uniform(0, 2 * np.pi)
        self.start = distance * np.array([np.cos(azimuth), np.sin(azimuth)])
        self.heading, self.speed, self.height = rng.uniform(0, 2 * np.pi), rng.uniform(120, 250), rng.uniform(2e3, 11e3)

    def latitude_longitude(self, t):
        """Geodetic coordinates at times, by distances north and east on the ellipsoid."""
        north, east = self.start[:, None] + self.speed * np.array([[np.cos(self.heading)], [np.sin(self.heading)]]) * t
        latitude = SITE[0] + north / 6.37e6
        return latitude, SITE[1] + east / 6.38e6 / np.cos(latitude)

    def distance_m(self, t):
        """Distances (n,) from the radar along the ellipsoid, with Euler's radius of curvature half-way."""
        latitude, longitude = self.latitude_longitude(t)
        middle = (latitude + SITE[0]) / 2
        east_radius = SEMI_MAJOR_M / np.sqrt(1 - SQUARED_ECCENTRICITY * np.sin(middle) ** 2)
        north_radius = east_radius**3 * (1 - SQUARED_ECCENTRICITY) / SEMI_MAJOR_M**2
        return np.hypot(north_radius * (latitude - SITE[0]), east_radius * np.cos(middle) * (longitude - SITE[1]))

    def at(self, t, height_error=0.0):
        """Positions (3, n) north, up and east of the radar."""
        return local(*self.latitude_longitude(t), np.full(len(t), self.height + height_error))


def recording(
    seed,
    world="sound",
    *,
    count=12,
    plots=45,
    farthest_m=110e3,
    correlation_s=0.0,
    outliers=0.0,
    position_m=0.0,
    lags_s=0.0,
    late_aircraft=None,
    noise=1.0,
    nearest_m=8e3,
    height_m=None,
):
    """Tables of plots and of positions.

    world: what is wrong with the radar or the positions; correlation_s: of errors within an aircraft; lags_s: the
    largest lag of an aircraft's positions; late_aircraft: one whose positions are 2 s late;
    noise: the size of all errors; height_m: of all aircraft."""
    rng = np.random.default_rng((seed, 49))
    plot_tables, position_tables = [], []
    for number in range(count):
        aircraft, name = Aircraft(rng, nearest_m, farthest_m), f"4c{number:04x}"
        aircraft.height = height_m or aircraft.height
        t = ROTATION_S * np.arange(plots) + rng.uniform(0, ROTATION_S)
        lag = TIME_S + (0.01 * t if world == "drift" else 0.0)
        north, up, east = aircraft.at(t - lag)
        r, b = np.sqrt(north**2 + up**2 + east**2), np.arctan2(east, north)
        if world == "ground":
            r = aircraft.distance_m(t - lag)
        if world == "squared":
            r = r + 60 * (r / 100e3) ** 2
        if world == "eccentric":
            b = b + np.radians(0.15) * np.sin(b)
        if world == "tilted":
            # Its axis leans by 1° to the north-east: the least rotation that makes it vertical shows what it sees.
            lean, level = np.radians(1.0), np.array([[np.sqrt(0.5)], [0.0], [np.sqrt(0.5)]])
            place = np.array([north, up, east])
            along = (level * place).sum(axis=0)
            place = place + level * ((np.cos(lean) - 1) * along - np.sin(lean) * up)
            b = np.arctan2(place[2], place[0])
        shape = (2, plots)
        errors = noise * rng.normal(size=shape) * np.where(rng.random(shape) < outliers, 20.0, 1.0)
        if correlation_s:
            share = np.exp(-ROTATION_S / correlation_s)
            for k in range(1, plots):
                errors[:, k] = share * errors[:, k - 1] + np.sqrt(1 - share**2) * errors[:, k]
        r = r + RANGE_M + SIGMA_RANGE_M * errors[0]
        b = b + BEARING_RAD + SIGMA_BEARING_RAD * errors[1]
        plot_tables.append(pd.DataFrame({"t_s": t, "track": name, "range_m": r, "bearing_rad": b % (2 * np.pi)}))
        fixes = np.arange(-15.0, ROTATION_S * plots + 20, 5.0) + rng.uniform(0, 5)
        own_lag = (rng.uniform(0, lags_s) if lags_s else 0.0) + (2.0 if number == late_aircraft else 0.0)
        place = aircraft.at(fixes - own_lag, 300.0 if world == "heights" else 0.0)
        place = place + position_m * rng.normal(size=place.shape)
        position_tables.append(
            pd.DataFrame({"t_s": fixes, "track": name, "x_m": place[0], "y_m": place[1], "z_m": place[2]})
        )
    return pd.concat(plot_tables, ignore_index=True), pd.concat(position_tables, ignore_index=True)
