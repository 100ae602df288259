"""Care for an installation and its results: doctor, self-test, cleaning, new studies, reproduction."""
