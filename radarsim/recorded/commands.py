"""`radarsim simulate`, `import`, `track`, `fit` and `register`. Heavy imports are inside the commands."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from radarsim.cli import group
from radarsim.cli.group import Count, config_argument, main, set_option
from radarsim.language import plural, tr

if TYPE_CHECKING:
    from radarsim.engine.results import Track


@main.command()
@config_argument
@click.option("-o", "--output", required=True, metavar="PLOTS.csv", help="File for the plots; also .npz and .parquet.")
@click.option("-i", "--realisation", type=Count(), help="The realisation, counted from 0.  [default: 0]")
@click.option("--realisations", type=group.Span(), help="Several, from FIRST up to, but not including, STOP.")
@set_option
def simulate(
    config: str, output: str, realisation: int | None, realisations: tuple[int, int] | None, overrides: tuple[str, ...]
) -> None:
    """Write the measurements of realisations, with the truth.

    The plots are exactly those that a run of CONFIG draws in this realisation: `radarsim track` over them gives the
    errors that the run accumulates. A missed plot is an empty cell; the truth is in columns true_….

    Several realisations follow one another in a CSV or Parquet file, with their number in the column `realisation`. An
    .npz file holds an array for each column, (realisations, scans), with NaN for a missed plot, the times t_s, and the
    seed.

    \b
    Example
      radarsim simulate rls2 -o plots.csv
      radarsim track rls2 plots.csv -o track.csv
      radarsim simulate rls2 --realisations 0:1e5 -o plots.npz
    """
    from radarsim.app import run
    from radarsim.cli import console
    from radarsim.recorded import follow
    from radarsim.recorded import plots as files

    if None not in (realisation, realisations):
        raise click.UsageError("--realisation and --realisations do not go together: give one of them")
    (loaded,) = run.load_all([config], overrides)
    number = realisation or 0
    if realisations is None and Path(output).suffix.lower() not in follow.FORMATS:
        columns = follow.simulated(loaded, number)
        files.write_columns(columns, output, loaded.path)
        rows = plural("{count} row", "{count} rows", len(columns["t_s"]))
        written = f"{rows}: {', '.join(columns)}"
    else:
        first, stop = realisations or (number, number + 1)
        with console.Counter("writing", "realisations") as counter:
            one = follow.write_many(loaded, stop - first, first, output, counter.update)
        many = plural("{count:,} realisation", "{count:,} realisations", stop - first)
        scans = plural("{count} scan", "{count} scans", len(one.t_s))
        told = {"realisations": many, "scans": scans, "names": ", ".join(one.columns)}
        written = tr("{realisations} of {scans}: {names}, and the truth", **told)
    console.field("plots", f"{output} ({written})")
    console.print_warnings(run.cache_troubles())


@main.command(name="import")
@click.argument("recording", metavar="FILE")
@click.option("-o", "--output", required=True, metavar="PLOTS.csv", help="File for the plots.")
@click.option(
    "--from",
    "kind",
    type=click.Choice(["asterix", "opensky", "ais", "csv", "json", "parquet", "gpx", "nmea"]),
    help="The format; default: detected from the content.",
)
@click.option(
    "--at",
    "places",
    multiple=True,
    metavar="[SAC/SIC=]LAT,LON,HEIGHT",
    help="Position of the radar: degrees, degrees, m (WGS 84); with several radars, one option for each, by name.",
)
@click.option(
    "--antenna",
    metavar="AZ,EL",
    help="Direction of the antenna's normal, degrees: adds the angles that multimodel reads.",
)
@click.option("--track", "tracks", multiple=True, metavar="ID", help="Only this track; repeatable.")
@click.option(
    "--truth",
    metavar="[ID=]FILE",
    help="A recording of positions; adds columns true_…, matched by aircraft and time. ID=: of this track alone.",
)
@click.option(
    "--time-from",
    default="first",
    show_default=True,
    metavar="ZERO",
    help="Zero of t_s: first (record), midnight, or a date and time (UTC).",
)
@click.option("--doppler-towards", is_flag=True, help="In the recording, Doppler is positive for approach.")
@click.option("--column", "columns", multiple=True, metavar="OURS=THEIRS", help="Name a CSV column explicitly.")
@click.option(
    "--bias",
    "biases",
    multiple=True,
    metavar="KEY=VALUE",
    help="Subtract a bias that `radarsim register` found: range_m, range_scale, bearing_deg or time_s; repeatable.",
)
@click.option(
    "--encoding", default="", metavar="NAME", help="Of text that is not UTF-8, as cp1251; default: Windows-1252."
)
@click.option(
    "--keep-marked", is_flag=True, help="Keep test targets, field monitors and coasted records in tracks and truth."
)
def import_(recording: str, output: str, **asked: Any) -> None:
    """Read ASTERIX, ADS-B, AIS, GPS or a table into plots.

    PLOTS.csv has one row per plot and all tracks of the recording, each named in the column `track`; `radarsim track`
    and `radarsim fit` read it. Its first lines describe the columns. For a damaged recording nothing is written.

    \b
    asterix  categories 048 and 001 (plots of a radar: range, bearing, height, Doppler speed
             and the span by which it is ambiguous), 021 and 062 (positions: the truth of the
             plots of the same aircraft), also in pcap and pcapng; needs radarsim[asterix]
    opensky  latitude, longitude, altitude and time of aircraft, in CSV; in feet and knots if
             the column names are those of aviation (gs, alt, …)
    json     traces and aircraft.json of readsb, states of OpenSky, data frames
    ais      sentences !AIVDM of ships; needs radarsim[ais]
    gpx      tracks of GPX; nmea: $GPRMC and $GPGGA of a satellite receiver
    csv      any table with a header: time, and range or latitude and longitude; units as in
             `range_km` or `Altitude [ft]`; separated by commas, semicolons or tabs;
             parquet: the same, needs radarsim[parquet]

    All positions on the earth need --at. Files may be gzipped.

    \b
    Example
      radarsim import radar.ast --at 52.30,4.76,12 -o plots.csv
      radarsim track range_doppler_own plots.csv -o track.csv
    """
    from radarsim.cli import console
    from radarsim.recorded import print_results
    from radarsim.recorded.formats import importing, sites
    from radarsim.report import wording

    antenna = sites.antenna_of(asked["antenna"]) if asked["antenna"] else None
    given: Any = (
        *(asked["kind"], *sites.sites_of(asked["places"]), antenna, asked["tracks"]),
        *(importing.zero_of(asked["time_from"]), *importing.truth_of(asked["truth"])),
        *(asked["doppler_towards"], importing.columns_of(asked["columns"])),
        *(importing.encoding_named(asked["encoding"]), asked["keep_marked"], importing.biases_of(asked["biases"])),
    )
    with console.Counter("reading", "records") as counter:
        done = importing.import_recording(recording, output, importing.Options(*given), counter.update)
    told = {"rows": plural("{count} row", "{count} rows", done.rows), "columns": ", ".join(done.columns)}
    told |= {"tracks": plural("{count} track", "{count} tracks", len([name for name in done.tracks if name]))}
    console.field("plots", f"{output} ({tr('{rows} of {tracks}: {columns}', **told)})")
    read = plural("{format}, {count} record read", "{format}, {count} records read", done.records, format=done.format)
    console.field("", read)
    for line in (*(tr("left out: {what}", what=what) for what in done.skipped), *done.notes):
        print_results.print_line(sys.stderr, wording.labelled("", line))


@main.command()
@config_argument
@click.argument("plots", metavar="PLOTS.csv")
@click.option("-o", "--output", metavar="TRACK.csv", help="File for the track; default: the terminal.")
@click.option("--report", metavar="DIR", help="Write a report into DIR: report.html and its figures.")
@group.threads_option
@click.option("-q", "--quiet", is_flag=True, help="Do not report gaps and accuracies.")
@set_option
def track(config: str, plots: str, output: str | None, quiet: bool, overrides: tuple[str, ...], **further: Any) -> None:
    """Run the config's filters over recorded measurements.

    PLOTS.csv has a header and one row per plot, with increasing times at any spacing. An empty cell is a missing value;
    other columns are ignored. Its columns are t_s and the measurements of the study's sensor, as `radarsim simulate`
    writes them: `range_m, velocity_mps` (range_doppler), `range_m, bearing_rad` (sonar), `range_m, elevation_rad,
    azimuth_rad` or `x_m, y_m, z_m` (multimodel).

    It also reports gaps and missing values, and whether the accuracies in the config agree with the plots: the filters'
    innovations are tested (NIS, 1 for a consistent filter). If a gap is so long that only rounding errors would follow,
    the command stops and names the line: split the file there.

    A file with a column `track`, as `radarsim import` writes it, holds several tracks, each processed separately; then
    TRACK.csv begins with the column recorded_track, and figures show the longest. If columns true_… give the truth, as
    `radarsim simulate` and `radarsim import` write it, the errors are reported.

    The report shows the plots (plan view, range), the estimates, the residuals with their bounds, the innovations over
    time, and all printed results.

    \b
    Example
      radarsim track sonar_smoothing plots.csv -o track.csv --report report
    """
    import contextlib

    from radarsim.app import run
    from radarsim.cli import console
    from radarsim.recorded import fit, follow, page, print_results
    from radarsim.recorded import plots as files
    from radarsim.report import wording
    from radarsim.report.files import Writer

    (loaded,) = run.load_all([config], overrides)
    read = {"the plots": plots, "the config": loaded.path}
    started = False

    def sink(piece: "Track", name: str | None) -> None:
        nonlocal started
        if not started:
            write([files.header_of(piece, name is not None)])
            started = True
        write(files.rows_of(piece, name))

    with contextlib.ExitStack() as stack:
        write = stack.enter_context(Writer(output, read)).write if output else print_results.print_rows
        counter = stack.enter_context(console.Counter("tracking", "rows"))
        followed = follow.follow(loaded, plots, sink, further["threads"], counter.update)
    folder = further["report"]
    if folder or not quiet:
        with console.Counter("judging", "likelihoods") as counter:
            judged = page.judged(followed)
            advised = fit.advised(followed, counter.update)
    if not quiet:
        print_results.print_track(followed, judged, advised, stderr=output is None)
    if output:
        console.field("track", output)
    if folder:
        page.write(followed, loaded, plots, judged, advised, folder)
        click.echo(wording.labelled("report", str(Path(folder) / page.NAME)), err=output is None)
    console.print_warnings(run.cache_troubles())


@main.command()
@config_argument
@click.argument("plots", metavar="PLOTS.csv")
@click.option(
    "--filter",
    "filter_name",
    metavar="NAME",
    help="The filter whose model is fitted; default: the one that uses most of a plot.",
)
@click.option("--robust", is_flag=True, help="Allow for outliers: plots with errors of ten times their σ.")
@click.option("--correlated", is_flag=True, help="Fit the correlation time of the errors, correlation_time_s, too.")
@click.option("--plain", is_flag=True, help="Allow for neither; default: for those that the plots show plainly.")
@click.option(
    "--write",
    metavar="MINE.yaml",
    help="Write the config with the fitted values; an existing file is never overwritten.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of text.")
@set_option
def fit(config: str, plots: str, overrides: tuple[str, ...], **options: Any) -> None:
    """Estimate σ and manoeuvre variance from recorded plots.

    The plots are as for `radarsim track`; several tracks in a file are fitted together. The value of each key maximises
    the likelihood of the plots under the filter's predictions; its interval is a profile-likelihood interval. A key
    whose interval has no lower or no upper bound cannot be determined from these plots.

    Where outliers, or errors that persist from plot to plot, are plain (by chance in one recording of 1000), the fit
    allows for them, and prints the plain values beside.

    \b
    Example
      radarsim simulate rls2 --set scans=60 -o plots.csv
      radarsim fit rls2 plots.csv
      radarsim fit rls2 plots.csv --write mine.yaml
    """
    from radarsim.app import configs, run, shown
    from radarsim.cli import console
    from radarsim.recorded import fit as fitting
    from radarsim.recorded import print_results
    from radarsim.report import wording
    from radarsim.studies.interface import CORRELATION, OUTLIERS

    (loaded,) = run.load_all([config], overrides)
    asked = tuple(what for what in (OUTLIERS, CORRELATION) if options[{OUTLIERS: "robust"}.get(what, "correlated")])
    if asked and options["plain"]:
        raise click.UsageError("--plain goes with neither --robust nor --correlated")
    allowing = asked if asked or options["plain"] else None
    if options["write"]:
        configs.writable(options["write"], loaded.path or config, overrides)
    with console.Counter("fitting", "likelihoods") as counter:
        found = fitting.fit(loaded, plots, options["filter_name"], allowing, counter.update)
    if options["as_json"]:
        click.echo(shown.text(fitting.as_rows(found)))
    else:
        print_results.print_fit(found)
    if options["write"]:
        path = Path(options["write"])
        made = configs.new(path.name, loaded.path or config, path.parent, fitting.settings(found), overrides)
        click.echo(wording.labelled("config", str(made)), err=options["as_json"])


@main.command()
@click.argument("radar", metavar="RADAR.csv")
@click.argument("other", metavar="[ID=]OTHER.csv")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of text.")
def register(radar: str, other: str, as_json: bool) -> None:
    """Find a radar's biases against ADS-B or another radar.

    Both files are as `radarsim import` writes them. Plots are compared with the positions of the aircraft that has
    their address, callsign or Mode 3/A code at that time, interpolated in between. A bias is what to subtract:
    range_scale from 1, the share of the range; time_s from the times, which are then too late. Outliers have no weight;
    errors may be correlated within an aircraft. What the flights cannot show is unknown, with the reason. OTHER is
    taken as right; for a radar that is tilted, or has moved, there is no model. ID is the track, address, callsign or
    code of the plots to which a lone receiver's positions belong.

    \b
    Example
      radarsim import radar.ast --at 52.30,4.76,12 -o radar.csv
      radarsim import adsb.csv --at 52.30,4.76,12 -o positions.csv
      radarsim register radar.csv positions.csv
    """
    from radarsim.app import shown
    from radarsim.recorded import print_results
    from radarsim.recorded import register as registering

    found = registering.register(radar, other)
    if as_json:
        click.echo(shown.text(registering.as_json(found)))
    else:
        print_results.print_registration(found, other)
