"""Tables, figures and sentences of user filters beside those of a config."""
