"""A folder a paper; what a study is, which there are, and what their numbers depend on."""
