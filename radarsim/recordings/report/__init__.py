"""Tables, figures, sentences and the page of recorded tracks."""
