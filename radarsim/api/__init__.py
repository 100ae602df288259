"""What the commands and Python's functions share: runs, results, comparisons, judging, and questions to a design."""
