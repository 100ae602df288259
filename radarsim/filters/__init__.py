"""Filter design: from options to the arrays that a kernel applies to every realisation."""
