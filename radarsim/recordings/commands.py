"""`radarsim simulate`, `import`, `track`, `fit` and `register`. Heavy imports are inside the commands."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from radarsim.cli import options
from radarsim.cli.command_group import main
from radarsim.cli.options import Count, config_argument, set_option
from radarsim.language.translate import plural, tr

if TYPE_CHECKING:
    from radarsim.studies.recording_interface import Track

    pass


@main.command()
@config_argument
@click.option("-o", "--output", required=True, metavar="PLOTS.csv", help="File for the plots; also .npz and .parquet.")
@click.option("-i", "--realisation", type=Count(), help="The realisation, counted from 0.  [default: 0]")
@click.option("--realisations", type=options.Span(), help="Several, from FIRST up to, but not including, STOP.")
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
    from radarsim.api import load_experiments, run_facts
    from radarsim.cli import console, progress
    from radarsim.recordings import bulk_plots, csv_output, simulate_plots

    if None not in (realisation, realisations):
        raise click.UsageError("--realisation and --realisations do not go together: give one of them")
    (loaded,) = load_experiments.load_all([config], overrides)
    number = realisation or 0
    if realisations is None and Path(output).suffix.lower() not in bulk_plots.BULK_WRITERS:
        columns = simulate_plots.simulate_realisation(loaded, number)
        csv_output.write_columns(columns, output, loaded.path)
        rows = plural("{count} row", "{count} rows", len(columns["t_s"]))
        written = f"{rows}: {', '.join(columns)}"
    else:
        first, stop = realisations or (number, number + 1)
        with progress.CountedProgress("writing", "realisations") as counter:
            layout = bulk_plots.write_realisations(loaded, stop - first, first, output, counter.update)
        realisation_count = plural("{count:,} realisation", "{count:,} realisations", stop - first)
        scans = plural("{count} scan", "{count} scans", len(layout.t_s))
        values = {"realisations": realisation_count, "scans": scans, "names": ", ".join(layout.columns)}
        written = tr("{realisations} of {scans}: {names}, and the truth", **values)
    console.print_field("plots", f"{output} ({written})")
    console.print_warnings(run_facts.cache_troubles())


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
    "--encoding", default="", metavar="NAME", help="Of text that is not UTF-8, as cp1251; default: recognised."
)
@click.option(
    "--keep-marked", is_flag=True, help="Keep test targets, field monitors and coasted records in tracks and truth."
)
@click.option("--allow-loss", is_flag=True, help="Import even if over a tenth of the rows must be left out.")
def import_(recording: str, output: str, **arguments: Any) -> None:
    """Read ASTERIX, ADS-B, AIS, GPS or a table into plots.

    PLOTS.csv has one row per plot and all tracks of the recording, each named in the column `track`; `radarsim track`
    and `radarsim fit` read it. Its first lines describe the columns. Rows out of order are sorted by time. For a
    damaged recording, or one with numbers that no target has, nothing is written.

    \b
    asterix  categories 048 and 001 (plots of a radar: range, bearing, height, Doppler speed
             and the span by which it is ambiguous), 021 and 062 (positions: the truth of the
             plots of the same aircraft), also in pcap and pcapng; needs radarsim[asterix]
    opensky  latitude, longitude, altitude and time of aircraft, in CSV; in feet and knots if
             the column names are those of aviation (gs, alt, …)
    json     traces and aircraft.json of readsb, states of OpenSky, data frames
    ais      sentences !AIVDM of ships; needs radarsim[ais]
    gpx      tracks of GPX; nmea: $GPRMC and $GPGGA of a satellite receiver, or
             $RATTM, the targets of a ship's radar
    csv      any table with a header, in English, German or Russian: time, and range or
             latitude and longitude; units as in `range_km` or `Altitude [ft]`; separated by
             commas, semicolons or tabs; lines of a BaseStation port (MSG,…);
             parquet: the same, needs radarsim[parquet]

    All positions on the earth need --at. Files may be gzipped.

    \b
    Example
      radarsim import radar.ast --at 52.30,4.76,12 -o plots.csv
      radarsim track range_doppler_own plots.csv -o track.csv
    """
    from radarsim.cli import console, progress
    from radarsim.recordings import print_results
    from radarsim.recordings.formats import import_options, import_recording, sites
    from radarsim.report import output_labels

    antenna = sites.parse_antenna(arguments["antenna"]) if arguments["antenna"] else None
    option_values: Any = (
        *(arguments["kind"], *sites.parse_sites(arguments["places"]), antenna, arguments["tracks"]),
        *(import_options.parse_zero(arguments["time_from"]), *import_options.parse_truth(arguments["truth"])),
        *(arguments["doppler_towards"], import_options.parse_columns(arguments["columns"])),
        *(
            import_options.check_encoding(arguments["encoding"]),
            arguments["keep_marked"],
            arguments["allow_loss"],
            import_options.parse_biases(arguments["biases"]),
        ),
    )
    with progress.CountedProgress("reading", "records") as counter:
        result = import_recording.import_recording(
            recording, output, import_options.Options(*option_values), counter.update
        )
    values = {"rows": plural("{count} row", "{count} rows", result.rows), "columns": ", ".join(result.columns)}
    values |= {"tracks": plural("{count} track", "{count} tracks", len([name for name in result.tracks if name]))}
    console.print_field("plots", f"{output} ({tr('{rows} of {tracks}: {columns}', **values)})")
    read = plural(
        "{format}, {count} record read", "{format}, {count} records read", result.records, format=result.format
    )
    console.print_field("", read)
    for line in (*(tr("left out: {what}", what=what) for what in result.skipped), *result.notes):
        print_results.print_line(sys.stderr, output_labels.labelled_line("", line))


@main.command()
@config_argument
@click.argument("plots", metavar="PLOTS.csv")
@click.option("-o", "--output", metavar="TRACK.csv", help="File for the track; default: the terminal.")
@click.option("--report", metavar="DIR", help="Write a report into DIR: report.html and its figures.")
@options.threads_option
@click.option("-q", "--quiet", is_flag=True, help="Do not report gaps and accuracies.")
@set_option
def track(
    config: str, plots: str, output: str | None, quiet: bool, overrides: tuple[str, ...], **arguments: Any
) -> None:
    """Run the config's filters over recorded measurements.

    PLOTS.csv has a header and one row per plot, with increasing times at any spacing. An empty cell is a missing value;
    other columns are ignored. Its columns are t_s and the measurements of the study's sensor, as `radarsim simulate`
    writes them: `range_m, velocity_mps` (range_doppler), `range_m, bearing_rad` (sonar), those and
    `velocity_mps` (plane), `range_m, elevation_rad, azimuth_rad` or `x_m, y_m, z_m` (multimodel).

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

    from radarsim.api import load_experiments, result_config, run_facts
    from radarsim.cli import console, progress
    from radarsim.recordings import csv_output, print_results
    from radarsim.recordings import track as recordings_track
    from radarsim.recordings.fit import advice
    from radarsim.recordings.report import innovation_tests, page
    from radarsim.report import output_labels
    from radarsim.report.atomic_files import OutputFile

    (loaded,) = load_experiments.load_all([config], overrides)
    read = {"the plots": plots, "the config": loaded.path}
    started = False

    def sink(piece: "Track", name: str | None) -> None:
        nonlocal started
        if not started:
            write([csv_output.track_header(piece, name is not None)])
            started = True
        write(csv_output.track_lines(piece, name))

    with contextlib.ExitStack() as stack:
        write = stack.enter_context(OutputFile(output, read)).write if output else print_results.print_rows
        counter = stack.enter_context(progress.CountedProgress("tracking", "rows"))
        followed = recordings_track.track_plots(loaded, plots, sink, arguments["threads"], counter.update)
    folder = arguments["report"]
    if folder or not quiet:
        with progress.CountedProgress("judging", "likelihoods") as counter:
            judged = innovation_tests.innovation_tests(followed)
            advised = advice.advise(followed, counter.update)
    if not quiet:
        print_results.print_track(followed, judged, advised, stderr=output is None)
    if output:
        console.print_field("track", output)
    if folder:
        page.write_page(followed, loaded, plots, judged, advised, folder, result_config.config_text(loaded))
        click.echo(output_labels.labelled_line("report", str(Path(folder) / page.PAGE_NAME)), err=output is None)
    console.print_warnings(run_facts.cache_troubles())


@main.command()
@config_argument
@click.argument("plots", metavar="PLOTS.csv")
@click.option(
    "--filter",
    "filter_name",
    metavar="NAME",
    help="The filter whose model is fitted; default: the one that uses most of a plot.",
)
@click.option("--robust", is_flag=True, help="Allow for outliers of any size, and name them.")
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

    If outliers or correlated errors are significant (0.1 % false alarms), the fit models them, and prints the values
    without them, too.

    \b
    Example
      radarsim simulate rls2 --set scans=60 -o plots.csv
      radarsim fit rls2 plots.csv
      radarsim fit rls2 plots.csv --write mine.yaml
    """
    from radarsim.api import json_output, load_experiments, new_configs
    from radarsim.cli import progress
    from radarsim.recordings import print_results
    from radarsim.recordings.fit import fit as fit_fit
    from radarsim.report import output_labels
    from radarsim.studies.error_law import CORRELATION, OUTLIERS

    (loaded,) = load_experiments.load_all([config], overrides)
    explanations = tuple(
        explanation
        for explanation in (OUTLIERS, CORRELATION)
        if options[{OUTLIERS: "robust"}.get(explanation, "correlated")]
    )
    if explanations and options["plain"]:
        raise click.UsageError("--plain goes with neither --robust nor --correlated")
    allowing = explanations if explanations or options["plain"] else None
    if options["write"]:
        new_configs.check_writable(options["write"], loaded.path or config, overrides)
    with progress.CountedProgress("fitting", "likelihoods") as counter:
        fitted = fit_fit.fit_plots(loaded, plots, options["filter_name"], allowing, counter.update)
    if options["as_json"]:
        click.echo(json_output.text(fit_fit.fit_rows(fitted)))
    else:
        print_results.print_fit(fitted)
    if options["write"]:
        path = Path(options["write"])
        config_path = new_configs.write_new_config(
            path.name, loaded.path or config, path.parent, fit_fit.fitted_settings(fitted), overrides
        )
        click.echo(output_labels.labelled_line("config", str(config_path)), err=options["as_json"])


@main.command()
@click.argument("radar", metavar="RADAR.csv")
@click.argument("other", metavar="[ID=]OTHER.csv")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of text.")
def register(radar: str, other: str, as_json: bool) -> None:
    """Find a radar's biases against ADS-B or another radar.

    Both files are as `radarsim import` writes them. Plots are compared with the positions of the aircraft that has
    their address, callsign or Mode 3/A code at that time, interpolated in between. Each bias is the amount to subtract.
    range_scale - 1 is the share of the range; a positive time_s means that the times are late. Outliers have no weight;
    errors may be correlated within an aircraft. What the flights cannot show is unknown, with the reason. OTHER is
    taken as right. Errors that these biases do not describe are named first, with what they go with. ID is the track,
    address, callsign or code of the plots to which a lone receiver's positions belong.

    \b
    Example
      radarsim import radar.ast --at 52.30,4.76,12 -o radar.csv
      radarsim import adsb.csv --at 52.30,4.76,12 -o positions.csv
      radarsim register radar.csv positions.csv
    """
    from radarsim.api import json_output
    from radarsim.recordings import print_results
    from radarsim.recordings.registration import register as registration_register
    from radarsim.recordings.registration import result

    registration = registration_register.register_radar(radar, other)
    if as_json:
        click.echo(json_output.text(result.registration_document(registration)))
    else:
        print_results.print_registration(registration, other)
