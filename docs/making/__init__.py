"""How the documentation is made: contents, generated pages, numbers from results, examples that run."""
