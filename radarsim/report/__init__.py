"""From sums to tables, figures, verdicts and the page of a run."""
