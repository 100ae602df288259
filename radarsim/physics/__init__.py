"""Motion of targets: transition matrices and process noise, reference frames, model and recorded courses."""
