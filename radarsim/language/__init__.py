"""The language of texts: catalogues, and functions that write a sentence in the current language."""
